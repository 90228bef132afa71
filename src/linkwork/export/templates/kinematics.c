/* Close the loops by Newton's steps, each shorter than the one before by far; tell whether that
   was possible, and the weakest determinant. */
static int lw_close_nearby(const lw_real *q TAKING_P, lw_real *found, lw_real *pivot)
{
    lw_real at[LW_Q], gap[1], length[1], longest = LW_LONGEST;
    int k;
    lw_copy(LW_Q, q, at);
    for (k = 0; k < LW_MOST_CORRECTIONS; ++k) {
        int closed;
        lw_closing_code(at WITH_P, found, gap, length, pivot);
        closed = gap[0] <= LW_OPEN;
        if (!(length[0] <= (closed ? LW_MET : longest)) || !lw_finite(found, LW_Q)) {
            return 0;
        }
        if (closed) {
            return 1;
        }
        longest = LW_CONTRACTS * length[0];
        lw_copy(LW_Q, found, at);
    }
    return 0;
}

PROTOTYPE
{
    lw_real here[LW_Q], trial[LW_Q], found[LW_Q], from[LW_A], sign[1], pivot[1];
    lw_real done = 0, part = 1;
    int k, i;
    if (!lw_finite(a, LW_A) || !lw_finite(q, LW_Q)) {
        return LW_NOT_FINITE;
    }
    if (!lw_close_nearby(q WITH_P, here, sign)) {
        return LW_NOT_CLOSED;
    }
    if (!(fabs(sign[0]) > LW_PIVOT_BOUND)) {
        return LW_SINGULAR;
    }
    for (i = 0; i < LW_A; ++i) {
        from[i] = here[lw_a_places[i]];
    }
    /* As long a part of the way as Newton's method goes, on the same side of singular poses. */
    for (k = 0; k < LW_MOST_PARTS && done < 1; ++k) {
        const lw_real end = done + part < 1 ? done + part : (lw_real)1;
        lw_copy(LW_Q, here, trial);
        for (i = 0; i < LW_A; ++i) {
            trial[lw_a_places[i]] = end < 1 ? from[i] + end * (a[i] - from[i]) : a[i];
        }
        if (lw_close_nearby(trial WITH_P, found, pivot) && pivot[0] * sign[0] > 0
            && fabs(pivot[0]) > LW_PIVOT_BOUND) {
            lw_copy(LW_Q, found, here);
            done = end;
            part *= 2;
        } else {
            part /= 2;
        }
    }
    if (done < 1) {
        return LW_NOT_CLOSED;
    }
    lw_settle(here WITH_P);
    lw_copy(LW_Q, here, q);
    lw_positions_code(q WITH_P, positions);
    lw_pose_code(q WITH_P, pose);
    return LW_OK;
}

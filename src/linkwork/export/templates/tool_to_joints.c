/* Lead the tool to where the part `left` of the errors is left, as lw_close_nearby does. */
static int lw_lead_nearby(
    const lw_real *q,
    const lw_real *x,
    const lw_real *left TAKING_P,
    lw_real *found,
    lw_real *pivot)
{
    lw_real at[LW_Q], gap[1], length[1], error[LW_X], longest = LW_LONGEST;
    int k;
    lw_copy(LW_Q, q, at);
    for (k = 0; k < LW_MOST_CORRECTIONS; ++k) {
        int met;
        lw_approaching_code(at, x, left WITH_P, found, gap, length, pivot, error);
        met = gap[0] <= LW_OPEN;
        if (!(length[0] <= (met ? LW_MET : longest)) || !lw_finite(found, LW_Q)) {
            return 0;
        }
        if (met) {
            return 1;
        }
        longest = LW_CONTRACTS * length[0];
        lw_copy(LW_Q, found, at);
    }
    return 0;
}

PROTOTYPE
{
    lw_real here[LW_Q], found[LW_Q], left[LW_X], error[LW_X], gap[1], length[1];
    lw_real sign[1], pivot[1], done = 0, part = 1;
    int k, i;
    if (!lw_finite(x, LW_X) || !lw_finite(q, LW_Q)) {
        return LW_NOT_FINITE;
    }
    for (i = 0; i < LW_X; ++i) {
        left[i] = 0;
    }
    lw_approaching_code(q, x, left WITH_P, found, gap, length, pivot, error);
    if (!lw_lead_nearby(q, x, error WITH_P, here, sign)) {
        return LW_NOT_CLOSED;
    }
    if (!(fabs(sign[0]) > LW_FLAT)) {
        return LW_SINGULAR;
    }
    /* As long a part of the way as Newton's method goes, on the same working mode. */
    for (k = 0; k < LW_MOST_PARTS && done < 1; ++k) {
        const lw_real end = done + part < 1 ? done + part : (lw_real)1;
        for (i = 0; i < LW_X; ++i) {
            left[i] = (1 - end) * error[i];
        }
        if (lw_lead_nearby(here, x, left WITH_P, found, pivot) && pivot[0] * sign[0] > 0
            && fabs(pivot[0]) > LW_FLAT) {
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
    lw_copy(LW_Q, here, q);
    lw_positions_code(q WITH_P, positions);
    return LW_OK;
}

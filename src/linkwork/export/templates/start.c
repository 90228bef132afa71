PROTOTYPE
{
    lw_real pivot[1], gap;
    lw_copy(LW_Q, q, state->q);
    if (!lw_finite(q, LW_Q) || !lw_finite(v, LW_V)) {
        return LW_NOT_FINITE;
    }
    gap = lw_settle(state->q WITH_P);
    if (!(gap <= LW_OPEN)) {
        return LW_NOT_CLOSED;
    }
    lw_rates_code(state->q, v WITH_P, state->w, pivot);
    state->t = 0;
    state->next = 0;
    state->own = 1;
    state->changes = 0;
    return lw_judged(pivot[0], state->w, LW_W);
}

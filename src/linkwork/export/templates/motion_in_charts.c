/* y' in a chart; pivot: the weakest one. */
static lw_status lw_slope(
    const lw_chart *chart,
    const lw_real *y,
    const lw_real *u TAKING_P,
    lw_real *dy,
    lw_real *pivot)
{
    lw_status status = LW_OK;
DRIVEN    lw_real given[LW_U + LW_Z], *dz = dy + LW_Q + LW_V;
DRIVEN    lw_join(u, y + LW_Q + LW_V, given);
    if (chart->own) {
        lw_motion_code(y, y + LW_Q, GIVEN WITH_P, dy, dy + LW_Q WITH_DZ, pivot);
        status = fabs(pivot[0]) > LW_WEAK ? LW_OK : LW_SINGULAR;
    }
OTHERWISE    else {
OTHERWISE        lw_real dw[LW_W];
OTHERWISE        status = lw_other_slope(chart, y, GIVEN WITH_P, dy, dw, pivot);
OTHERWISE    }
    if (status == LW_OK && !lw_finite(dy, LW_Y)) {
        status = LW_NOT_FINITE;
    }
    return status;
}

/* Return the state at the time t with y in a chart, its loops closed. */
static lw_status lw_arrive(
    const lw_chart *chart,
    const lw_real *y,
    lw_real t TAKING_P,
    lw_state *state)
{
    lw_state next = *state;
    lw_real pivot[1] = {1}, gap = 0;
    lw_copy(LW_Q, y, next.q);
    if (chart->own) {
        gap = lw_settle(next.q WITH_P);
        lw_rates_code(next.q, y + LW_Q WITH_P, next.w, pivot);
    }
OTHERWISE    else {
OTHERWISE        lw_real phi[LW_PHI], Phi[LW_PHI * LW_W], after[1], L[LW_W][LW_V];
OTHERWISE        gap = lw_other_settle(chart, next.q WITH_P);
OTHERWISE        lw_free_closure_code(next.q WITH_P, phi, Phi, after);
OTHERWISE        if (!lw_other_map(chart, Phi, L)) {
OTHERWISE            return LW_SINGULAR;
OTHERWISE        }
OTHERWISE        lw_other_rates(L, y + LW_Q, next.w);
OTHERWISE    }
    if (!(gap <= LW_OPEN)) {
        return LW_NOT_CLOSED;
    }
    if (!(fabs(pivot[0]) > LW_PIVOT_BOUND)) {
        return LW_SINGULAR;
    }
    if (!lw_finite(next.w, LW_W)) {
        return LW_NOT_FINITE;
    }
DRIVEN    lw_copy(LW_Z, y + LW_Q + LW_V, next.z);
    next.t = t;
    next.changes += next.own != chart->own;
    next.own = chart->own;
    *state = next;
    return LW_OK;
}

/* y of a state in a chart. */
static void lw_leave(const lw_chart *chart, const lw_state *state, lw_real *y)
{
    int k;
    lw_copy(LW_Q, state->q, y);
    for (k = 0; k < LW_V; ++k) {
        y[LW_Q + k] = state->w[chart->independent[k]];
    }
DRIVEN    lw_copy(LW_Z, state->z, y + LW_Q + LW_V);
}

/* Choose the chart of the next step: the own one, from a strong pivot on where it was left. least:
   pivot down to which others determine the motion. */
static lw_status lw_first_chart(const lw_state *state, lw_real least TAKING_P, lw_chart *chart)
{
    lw_own_chart(chart);
OTHERWISE    chart->least = least;
OTHERWISE    if (!state->own) {
OTHERWISE        const lw_real rest[LW_V] = {0};
OTHERWISE        lw_real w[LW_W], pivot[1];
OTHERWISE        lw_rates_code(state->q, rest WITH_P, w, pivot);
OTHERWISE        if (!(fabs(pivot[0]) > LW_REUSED)) {
OTHERWISE            return lw_best_chart(state->q WITH_P, chart) ? LW_OK : LW_SINGULAR;
OTHERWISE        }
OTHERWISE    }
    NOTHING_OF_STATE
    return LW_OK;
}

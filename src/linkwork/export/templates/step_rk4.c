static lw_status lw_rk4(
    const lw_chart *chart,
    const lw_state *state,
    const lw_real *u,
    lw_real dt TAKING_P,
    lw_real *end)
{
    static const lw_real reach[3] = {(lw_real)0.5, (lw_real)0.5, 1};
    lw_real y[LW_Y], k[4][LW_Y], trial[LW_Y], pivot[4][1];
    int stage, i;
    lw_leave(chart, state, y);
    lw_copy(LW_Y, y, trial);
    for (stage = 0; stage < 4; ++stage) {
        const lw_status status = lw_slope(chart, trial, u WITH_P, k[stage], pivot[stage]);
        if (status != LW_OK) {
            return status;
        }
        if (!(pivot[stage][0] * pivot[0][0] > 0)) {
            return LW_SINGULAR;
        }
        for (i = 0; i < LW_Y && stage < 3; ++i) {
            trial[i] = y[i] + dt * reach[stage] * k[stage][i];
        }
    }
    for (i = 0; i < LW_Y; ++i) {
        end[i] = y[i] + dt / 6 * (k[0][i] + 2 * (k[1][i] + k[2][i]) + k[3][i]);
    }
    return LW_OK;
}

PROTOTYPE
{
    lw_chart chart;
    lw_real end[LW_Y];
    int attempt;
    lw_status status = lw_finite(&dt, 1) ? lw_first_chart(state, LW_LOST WITH_P, &chart) : LW_NOT_FINITE;
    for (attempt = 0; attempt < 2 && status == LW_OK; ++attempt) {
        status = lw_rk4(&chart, state, u, dt WITH_P, end);
        if (status == LW_OK) {
            status = lw_arrive(&chart, end, state->t + dt WITH_P, state);
            if (status == LW_OK) {
                return LW_OK;
            }
        }
OTHERWISE        if (chart.own && attempt == 0 && lw_best_chart(state->q WITH_P, &chart)) {
OTHERWISE            status = LW_OK;
OTHERWISE        }
    }
    return status;
}

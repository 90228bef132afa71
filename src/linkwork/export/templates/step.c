/* A step of the method of Dormand and Prince, and its error over what is allowed. */
static lw_status lw_dormand_prince(
    const lw_chart *chart,
    const lw_state *state,
    const lw_real *u,
    lw_real h,
    lw_real rtol,
    lw_real atol TAKING_P,
    lw_real *end,
    lw_real *error)
{
    static const lw_real a[6][6] = {WEIGHTS};
    static const lw_real e[7] = {ERRORS};
    lw_real y[LW_Y], k[7][LW_Y], pivot[7][1];
    int stage, i, j;
    lw_leave(chart, state, y);
    lw_copy(LW_Y, y, end);
    for (stage = 0; stage < 7; ++stage) {
        const lw_status status = lw_slope(chart, end, u WITH_P, k[stage], pivot[stage]);
        if (status != LW_OK) {
            return status;
        }
        if (!(pivot[stage][0] * pivot[0][0] > 0)) {
            return LW_SINGULAR;
        }
        for (i = 0; i < LW_Y && stage < 6; ++i) {
            lw_real sum = 0;
            for (j = 0; j <= stage; ++j) {
                sum += a[stage][j] * k[j][i];
            }
            end[i] = y[i] + h * sum;
        }
    }
    *error = 0;
    for (i = 0; i < LW_Y; ++i) {
        const lw_real unit = UNIT_OF_STATE;
        const lw_real size = fabs(y[i]) > fabs(end[i]) ? fabs(y[i]) : fabs(end[i]);
        lw_real sum = 0;
        for (j = 0; j < 7; ++j) {
            sum += e[j] * k[j][i];
        }
        sum = fabs(h * sum) / (atol * unit + rtol * size);
        *error = sum > *error || sum != sum ? sum : *error;
    }
    return LW_OK;
}

PROTOTYPE
{
    const lw_real begin = state->t, stop = begin + dt;
    lw_real end[LW_Y];
    int count;
    if (!(dt > 0 && rtol >= 0 && atol >= 0 && rtol + atol > 0)) {
        return LW_OUT_OF_RANGE;
    }
    if (!(state->next > 0)) {
        state->next = dt / 8;
    }
    for (count = 0; count < LW_MOST_STEPS; ++count) {
        const lw_real gap = stop - state->t;
        const lw_real h = state->next >= gap ? gap : state->next > gap / 2 ? gap / 2 : state->next;
        lw_real error = 0, factor = (lw_real)0.25;
        lw_chart chart;
        lw_status status = lw_first_chart(state WITH_P, &chart);
        int attempt;
        for (attempt = 0; attempt < 2 && status == LW_OK; ++attempt) {
            status = lw_dormand_prince(&chart, state, u, h, rtol, atol WITH_P, end, &error);
OTHERWISE            if (status == LW_SINGULAR && chart.own) {
OTHERWISE                status = lw_best_chart(state->q WITH_P, &chart) ? LW_OK : LW_SINGULAR;
OTHERWISE                continue;
OTHERWISE            }
            break;
        }
        /* The next step is as long as the error allows, a quarter of this one where it failed. */
        if (status == LW_OK) {
            factor = error > 0 ? (lw_real)0.9 * pow(error, (lw_real)-0.2) : (lw_real)5;
            factor = factor > 5 ? (lw_real)5 : factor > (lw_real)0.2 ? factor : (lw_real)0.2;
        }
        if (status == LW_OK && error <= 1) {
            const lw_real t = h < gap ? state->t + h : stop;
            status = lw_arrive(&chart, end, t WITH_P, state);
            if (status == LW_OK) {
                /* A step that the end has cut short says little of longer ones. */
                if (!(h < state->next && factor >= 1 && h * factor < state->next)) {
                    state->next = h * factor;
                }
                if (!(h < gap)) {
                    return LW_OK;
                }
                continue;
            }
            factor = (lw_real)0.25;
        }
        state->next = h * factor;
        if (!(state->next > LW_SMALLEST_STEP * (fabs(stop) > dt ? fabs(stop) : dt))) {
            return status == LW_OK ? LW_STEP_TOO_SHORT : status;
        }
    }
    return LW_TOO_MANY_STEPS;
}

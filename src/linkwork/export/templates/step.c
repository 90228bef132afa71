OTHERWISE/* Tell whether pivots of a step change too much, where they are nearly lost, for what vanishes between
OTHERWISE   its stages to be seen. */
OTHERWISE static int lw_weakens(lw_real before, lw_real now)
OTHERWISE {
OTHERWISE    const lw_real ratio = now / before;
OTHERWISE    return (fabs(before) < LW_LOST || fabs(now) < LW_LOST) && !(ratio > (lw_real)0.5 && ratio < 2);
OTHERWISE }

/* A step of the method of Dormand and Prince, and its error over what is allowed. */
static lw_status lw_dormand_prince(
    const lw_chart *chart,
    const lw_state *state,
    const lw_real *u,
    lw_real h,
    lw_real rtol,
    lw_real atol TAKING_P,
    lw_real *end TAKING_SLOPES,
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
OTHERWISE        if (!chart->own && lw_weakens(pivot[0][0], pivot[stage][0])) {
OTHERWISE            return LW_SINGULAR;
OTHERWISE        }
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
MEETING    lw_copy(LW_Y, k[0], slopes[0]);
MEETING    lw_copy(LW_Y, k[6], slopes[1]);
    return LW_OK;
}

MEETING/* Tell on which side what may meet is after a part of a step, from its ends and slopes there: -1
MEETING   where it presses, 1 where it does not, 0 where it touches to rounding. */
MEETING static void lw_sides(
MEETING    const lw_real *y,
MEETING    const lw_real *end,
MEETING    lw_real slopes[2][LW_Y],
MEETING    lw_real h,
MEETING    lw_real part TAKING_P,
MEETING    int *sides)
MEETING {
MEETING    lw_real q[LW_Q], apart[COUNT_OF_MEETINGS], size = 0;
MEETING    const lw_real rest = 1 - part;
MEETING    int i;
MEETING    for (i = 0; i < LW_Q; ++i) {
MEETING        const lw_real change = end[i] - y[i];
MEETING        const lw_real bend = (1 - 2 * part) * change
MEETING            + h * (part * slopes[1][i] - rest * slopes[0][i]);
MEETING        const lw_real own = fabs(y[i]) > lw_q_units[i] ? fabs(y[i]) : lw_q_units[i];
MEETING        q[i] = y[i] + part * (change - rest * bend);
MEETING        size = own > size ? own : size;
MEETING    }
MEETING    lw_meeting_code(q WITH_P, apart);
MEETING    for (i = 0; i < COUNT_OF_MEETINGS; ++i) {
MEETING        const lw_real near = LW_TOUCHING * size;
MEETING        sides[i] = apart[i] > near ? 1 : apart[i] < -near ? -1 : 0;
MEETING    }
MEETING }
MEETING
MEETING/* Return the part of a step after which the first of what may meet begins or ceases to press; 1
MEETING   where nothing does. What does so at its very beginning has done so, and what touches there is
MEETING   on the side to which it comes off. */
MEETING static lw_real lw_meets_after(
MEETING    const lw_real *y, const lw_real *end, lw_real slopes[2][LW_Y], lw_real h TAKING_P)
MEETING {
MEETING    int before[COUNT_OF_MEETINGS], now[COUNT_OF_MEETINGS], changed = 0, i, k;
MEETING    lw_real low = LW_BEGUN, high = 1;
MEETING    lw_sides(y, end, slopes, h, low WITH_P, before);
MEETING    for (k = 1; k <= LW_LOOKS + LW_HALVINGS && (k <= LW_LOOKS || changed); ++k) {
MEETING        const lw_real part = changed ? (low + high) / 2 : (lw_real)k / LW_LOOKS;
MEETING        int differs = 0;
MEETING        lw_sides(y, end, slopes, h, part WITH_P, now);
MEETING        for (i = 0; i < COUNT_OF_MEETINGS; ++i) {
MEETING            differs = differs || now[i] * before[i] < 0;
MEETING            before[i] = before[i] == 0 && !changed ? now[i] : before[i];
MEETING        }
MEETING        if (differs) {
MEETING            high = part;
MEETING            changed = 1;
MEETING        }
MEETING        else {
MEETING            low = part;
MEETING        }
MEETING    }
MEETING    return high;
MEETING }
MEETING
MEETING/* End a step where what may meet begins or ceases to press: shorter, and again as far as that
MEETING   shows the place more closely. */
MEETING static lw_status lw_up_to_meeting(
MEETING    const lw_chart *chart,
MEETING    const lw_state *state,
MEETING    const lw_real *u,
MEETING    lw_real rtol,
MEETING    lw_real atol TAKING_P,
MEETING    lw_real *end,
MEETING    lw_real slopes[2][LW_Y],
MEETING    lw_real *h)
MEETING {
MEETING    lw_real y[LW_Y], error;
MEETING    lw_status status = LW_OK;
MEETING    int count;
MEETING    lw_leave(chart, state, y);
MEETING    for (count = 0; count < LW_CORRECTIONS && status == LW_OK; ++count) {
MEETING        const lw_real part = lw_meets_after(y, end, slopes, *h WITH_P);
MEETING        if (!(part < 1)) {
MEETING            return LW_OK;
MEETING        }
MEETING        *h *= part;
MEETING        status = lw_dormand_prince(
MEETING            chart, state, u, *h, rtol, atol WITH_P, end WITH_SLOPES, &error);
MEETING    }
MEETING    return status;
MEETING }

PROTOTYPE
{
    const lw_real begin = state->t, stop = begin + dt;
    lw_real end[LW_Y];
MEETING    lw_real slopes[2][LW_Y];
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
        lw_real error = 0, factor = (lw_real)0.25, taken;
        lw_chart chart;
        lw_status status = lw_first_chart(state, LW_HARD WITH_P, &chart);
        int attempt;
        for (attempt = 0; attempt < 2 && status == LW_OK; ++attempt) {
            status = lw_dormand_prince(
                &chart, state, u, h, rtol, atol WITH_P, end WITH_SLOPES, &error);
OTHERWISE            if (status == LW_SINGULAR && chart.own) {
OTHERWISE                status = lw_best_chart(state->q WITH_P, &chart) ? LW_OK : LW_SINGULAR;
OTHERWISE                continue;
OTHERWISE            }
            break;
        }
        taken = h;
MEETING        if (status == LW_OK && error <= 1) {
MEETING            status = lw_up_to_meeting(
MEETING                &chart, state, u, rtol, atol WITH_P, end, slopes, &taken);
MEETING        }
        /* The next step is as long as the error allows, a quarter of this one where it failed. */
        if (status == LW_OK) {
            factor = error > 0 ? (lw_real)0.9 * pow(error, (lw_real)-0.2) : (lw_real)5;
            factor = factor > 5 ? (lw_real)5 : factor > (lw_real)0.2 ? factor : (lw_real)0.2;
        }
        if (status == LW_OK && error <= 1) {
            const lw_real t = taken < gap ? state->t + taken : stop;
            status = lw_arrive(&chart, end, t WITH_P, state);
            if (status == LW_OK) {
                /* A step that the end has cut short says little of longer ones. */
                if (!(h < state->next && factor >= 1 && h * factor < state->next)) {
                    state->next = h * factor;
                }
                if (!(taken < gap)) {
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

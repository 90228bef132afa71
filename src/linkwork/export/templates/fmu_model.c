void lw_model_reset(lw_model *model)
{
    static const lw_real start[LW_VALUES] = START_VALUES;
    lw_chart chart;
    memset(model, 0, sizeof *model);
    lw_copy(LW_VALUES, start, model->values);
    model->rtol = (lw_real)1e-8;
    lw_own_chart(&chart);
    lw_choose(&chart, &model->kept);
}

lw_status lw_model_begin(lw_model *model)
{
    lw_real *values = model->values, q[LW_Q];
    lw_status status;
    lw_state state;
    lw_chart chart;
WITHFREE    const lw_parameters given = lw_given(values), *p = &given;
    lw_copy(LW_Q, lw_home, q);
BYTOOL     if (model->start_at_tool) {
BYTOOL         lw_real positions[LW_JOINTS + 1];
BYTOOL         status = lw_tool_to_joints(values + LW_AT_START_TOOL WITH_P, q, positions);
BYTOOL     } else
    {
BYJOINTS         lw_real positions[LW_JOINTS + 1], pose[LW_POSE + 1];
BYJOINTS         status = lw_kinematics(values + LW_AT_START WITH_P, q, positions, pose);
BYTREE         /* Its loops are closed where the motion starts. */
BYTREE         lw_copy(LW_Q, values + LW_AT_START, q);
BYTREE         status = LW_OK;
    }
    if (status == LW_OK) {
        status = lw_start(q, values + LW_AT_START_RATES WITH_P, &state);
    }
    if (status == LW_OK) {
        lw_copy(LW_Q, state.q, values + LW_AT_Q);
        lw_copy(LW_W, state.w, values + LW_AT_W);
DRIVEN        lw_copy(LW_Z, values + LW_AT_START_DRIVES, values + LW_AT_Z);
        lw_own_chart(&chart);
        lw_choose(&chart, &model->kept);
        model->next = 0;
        model->changes = 0;
        model->moved = 0;
        model->known = 0;
    }
    return status;
}

/* Close the loops of states in a chart, with no coordinate moved farther, and find q' and w'. */
static lw_status lw_closed_motion(
    const lw_chart *chart,
    const lw_real *values,
    lw_real farthest TAKING_P,
    lw_state *closed,
    lw_real *dq,
    lw_real *dw TAKING_DZ)
{
    lw_real y[LW_Y], w[LW_W], pivot[1] = {1};
    const lw_real *u = values + LW_AT_U;
DRIVEN    lw_real given[LW_U + LW_Z];
    lw_status status;
    int k;
DRIVEN    lw_join(u, values + LW_AT_Z, given);
    lw_copy(LW_Q, values + LW_AT_Q, closed->q);
    lw_copy(LW_W, values + LW_AT_W, closed->w);
    closed->t = closed->next = 0;
    closed->own = chart->own;
    closed->changes = 0;
DRIVEN    lw_copy(LW_Z, values + LW_AT_Z, closed->z);
    if (!lw_finite(closed->q, LW_Q) || !lw_finite(closed->w, LW_W)) {
        return LW_NOT_FINITE;
    }
    lw_leave(chart, closed, y);
    status = lw_arrive(chart, y, 0 WITH_P, closed);
    if (status != LW_OK) {
        return status;
    }
    /* Where the independent rates are weak Newton's method may have left the branch. */
    for (k = 0; k < LW_Q; ++k) {
        if (fabs(closed->q[k] - y[k]) > farthest * lw_q_units[k]) {
            return LW_NOT_CLOSED;
        }
    }
    lw_leave(chart, closed, y);
    if (chart->own) {
        lw_own_motion_code(y, y + LW_Q, GIVEN WITH_P, dq, w, dw WITH_DZ, pivot);
        status = fabs(pivot[0]) > LW_WEAK ? LW_OK : LW_SINGULAR;
    }
OTHERWISE    else {
OTHERWISE        lw_real dy[LW_Y];
OTHERWISE        status = lw_other_slope(chart, y, GIVEN WITH_P, dy, dw, pivot);
OTHERWISE        lw_copy(LW_Q, dy, dq);
OTHERDRIVEN        lw_copy(LW_Z, dy + LW_Q + LW_V, dz);
OTHERWISE    }
    if (status == LW_OK && (!lw_finite(dq, LW_Q) || !lw_finite(dw, LW_W))) {
        status = LW_NOT_FINITE;
    }
DRIVEN    if (status == LW_OK && !lw_finite(dz, LW_Z)) {
DRIVEN        status = LW_NOT_FINITE;
DRIVEN    }
    (void)w;
    return status;
}

lw_status lw_model_evaluate(lw_model *model)
{
    lw_real *values = model->values, *dq = values + LW_AT_DQ, *dw = values + LW_AT_DW;
DRIVEN    lw_real *dz = values + LW_AT_DZ;
    const lw_real farthest = model->moved ? LW_LONGEST : LW_FARTHEST;
    lw_chart chart;
    lw_state closed;
    lw_status status;
OTHERWISE    int is_kept = 1;
WITHFREE    const lw_parameters given = lw_given(values), *p = &given;
    if (model->known) {
        return LW_OK;
    }
    lw_chosen(&model->kept, &chart);
    status = lw_closed_motion(&chart, values, farthest WITH_P, &closed, dq, dw WITH_DZ);
OTHERWISE    if (status == LW_SINGULAR || status == LW_NOT_CLOSED) {
OTHERWISE        if (!lw_best_chart(values + LW_AT_Q WITH_P, &chart)) {
OTHERWISE            return status;
OTHERWISE        }
OTHERWISE        is_kept = 0;
OTHERWISE        status = lw_closed_motion(&chart, values, farthest WITH_P, &closed, dq, dw WITH_DZ);
OTHERWISE    }
    if (status != LW_OK) {
        return status;
    }
    lw_telling_code(closed.q, closed.w, dw WITH_P, values + LW_AT_TOLD);
    lw_gap_code(values + LW_AT_Q WITH_P, values + LW_AT_GAP);
    if (!lw_finite(values + LW_AT_TOLD, LW_VALUES - LW_AT_TOLD)) {
        return LW_NOT_FINITE;
    }
    lw_copy(LW_Q, closed.q, model->closed_q);
    lw_copy(LW_W, closed.w, model->closed_w);
OTHERWISE    /* Where the kept choice is of no use another is kept from here on: an event is due. */
OTHERWISE    if (!is_kept) {
OTHERWISE        lw_choose(&chart, &model->kept);
OTHERWISE        model->changes += 1;
OTHERWISE        model->moved = 1;
OTHERWISE    }
    model->known = 1;
    return LW_OK;
}

int lw_model_is_due(const lw_model *model)
{
    int is_due = model->moved || model->values[LW_AT_GAP] > LW_DRIFTED;
OTHERWISE    is_due = is_due || lw_is_weak(model);
    return is_due;
}

lw_status lw_model_event(lw_model *model, int *changed)
{
    lw_real *values = model->values;
    int is_new = 0;
    lw_status status = lw_model_evaluate(model);
    *changed = 0;
    if (status != LW_OK) {
        return status;
    }
OTHERWISE    status = lw_choose_again(model, &is_new);
OTHERWISE    if (status != LW_OK) {
OTHERWISE        return status;
OTHERWISE    }
    if (is_new || model->moved || values[LW_AT_GAP] > LW_CLOSED) {
        lw_copy(LW_Q, model->closed_q, values + LW_AT_Q);
        lw_copy(LW_W, model->closed_w, values + LW_AT_W);
        model->moved = 0;
        model->known = 0;
        *changed = 1;
        status = lw_model_evaluate(model);
    }
    return status;
}

lw_status lw_model_step(lw_model *model, lw_real dt)
{
    lw_real *values = model->values;
WITHFREE    const lw_parameters given = lw_given(values), *p = &given;
    lw_state state;
    lw_chart chart;
    lw_status status = lw_model_evaluate(model), chosen;
    if (status != LW_OK) {
        return status;
    }
    lw_copy(LW_Q, model->closed_q, state.q);
    lw_copy(LW_W, model->closed_w, state.w);
DRIVEN    lw_copy(LW_Z, values + LW_AT_Z, state.z);
    state.t = values[LW_AT_TIME];
    state.next = model->next;
    state.own = model->kept.own;
    state.changes = model->changes;
    status = lw_step(
        values + LW_AT_U, dt, model->rtol, model->rtol / 100 WITH_P, &state);
    values[LW_AT_TIME] = state.t;
    lw_copy(LW_Q, state.q, values + LW_AT_Q);
    lw_copy(LW_W, state.w, values + LW_AT_W);
DRIVEN    lw_copy(LW_Z, state.z, values + LW_AT_Z);
    model->next = state.next;
    model->changes = state.changes;
    model->moved = 0;
    model->known = 0;
    chosen = lw_first_chart(&state, LW_LOST WITH_P, &chart);
    if (chosen == LW_OK) {
        lw_choose(&chart, &model->kept);
    }
    return status == LW_OK ? chosen : status;
}

lw_status lw_model_tangent(
    const lw_model *model, lw_work *work, const lw_real *seeds, lw_real *found)
{
    const lw_real *values = model->values, *q = model->closed_q, *w = model->closed_w;
    const lw_real *sp = seeds + LW_AT_P;
UNDRIVEN    const lw_real *u = values + LW_AT_U, *su = seeds + LW_AT_U;
    lw_real tq[LW_Q], tw[LW_W];
DRIVEN    lw_real u[LW_U + LW_Z], su[LW_U + LW_Z], *tdz = found + LW_AT_DZ;
    lw_status status = LW_OK;
WITHFREE    const lw_parameters given = lw_given(values), *p = &given;
    lw_copy(LW_VALUES, seeds, found);
DRIVEN    lw_join(values + LW_AT_U, values + LW_AT_Z, u);
DRIVEN    lw_join(seeds + LW_AT_U, seeds + LW_AT_Z, su);
    if (model->kept.own) {
        lw_real v[LW_V];
        int k;
        for (k = 0; k < LW_V; ++k) {
            v[k] = w[lw_v_places[k]];
        }
        lw_own_tangent_code(
            q,
            v,
            u,
            seeds + LW_AT_Q,
            seeds + LW_AT_W,
            su,
            sp WITH_P,
            tq,
            found + LW_AT_DQ,
            tw,
            found + LW_AT_DW WITH_TDZ);
    }
OTHERWISE    else {
OTHERWISE        lw_chart chart;
OTHERWISE        lw_chosen(&model->kept, &chart);
OTHERWISE        status = lw_other_tangent(
OTHERWISE            &chart, model, seeds, u, su WITH_P, tq, found + LW_AT_DQ, tw, found + LW_AT_DW WITH_TDZ);
OTHERWISE    }
    lw_telling_tangent_code(
        q,
        w,
        values + LW_AT_DW,
        tq,
        tw,
        found + LW_AT_DW,
        sp WITH_P,
        found + LW_AT_TOLD);
    lw_gap_tangent_code(
        values + LW_AT_Q, seeds + LW_AT_Q, sp WITH_P, found + LW_AT_GAP);
REACTING    if (status == LW_OK) {
REACTING        status = lw_reaction_tangent(model, work, seeds, u, su, tq, tw WITH_P, found);
REACTING    }
    (void)work;
    if (status == LW_OK && !lw_finite(found + LW_AT_DQ, LW_VALUES - LW_AT_DQ)) {
        status = LW_NOT_FINITE;
    }
    return status;
}

void lw_model_nominals(lw_real *nominals)
{
    lw_copy(LW_Q, lw_q_units, nominals);
    lw_copy(LW_W, lw_w_units, nominals + LW_Q);
DRIVEN    lw_copy(LW_Z, lw_z_units, nominals + LW_Q + LW_W);
}

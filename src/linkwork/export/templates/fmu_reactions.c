/* Solve K x = b, where LW_V equations depend on the others, by elimination with the strongest pivot
   each time; what is left open is zero. Pivots go with the squares of the conditions' own numbers,
   those of equations that depend on others are of rounding, 1e-15. */
static lw_status lw_balance(lw_work *work, const lw_real *b, lw_real *x)
{
    static const int rows[] = {BALANCE_ROWS}, columns[] = {BALANCE_COLUMNS};
    int order[LW_UNKNOWNS], i, j, k;
    for (i = 0; i < LW_UNKNOWNS; ++i) {
        order[i] = i;
        for (j = 0; j < LW_UNKNOWNS; ++j) {
            work->A[i][j] = 0;
        }
        work->A[i][LW_UNKNOWNS] = b[i];
        x[i] = 0;
    }
    for (k = 0; k < (int)(sizeof rows / sizeof rows[0]); ++k) {
        work->A[rows[k]][columns[k]] = work->K[k];
    }
    for (k = 0; k < LW_UNKNOWNS - LW_V; ++k) {
        int row = k, column = k;
        lw_real strongest = 0;
        for (i = k; i < LW_UNKNOWNS; ++i) {
            for (j = k; j < LW_UNKNOWNS; ++j) {
                if (fabs(work->A[i][j]) > strongest) {
                    strongest = fabs(work->A[i][j]);
                    row = i;
                    column = j;
                }
            }
        }
        if (!(strongest > 1e-10)) {
            return LW_SINGULAR;
        }
        for (j = 0; j <= LW_UNKNOWNS; ++j) {
            const lw_real kept = work->A[k][j];
            work->A[k][j] = work->A[row][j];
            work->A[row][j] = kept;
        }
        for (i = 0; i < LW_UNKNOWNS; ++i) {
            const lw_real kept = work->A[i][k];
            work->A[i][k] = work->A[i][column];
            work->A[i][column] = kept;
        }
        i = order[k];
        order[k] = order[column];
        order[column] = i;
        for (i = k + 1; i < LW_UNKNOWNS; ++i) {
            const lw_real factor = work->A[i][k] / work->A[k][k];
            for (j = k; j <= LW_UNKNOWNS && factor != 0; ++j) {
                work->A[i][j] -= factor * work->A[k][j];
            }
        }
    }
    for (k = LW_UNKNOWNS - LW_V - 1; k >= 0; --k) {
        lw_real sum = work->A[k][LW_UNKNOWNS];
        for (j = k + 1; j < LW_UNKNOWNS - LW_V; ++j) {
            sum -= work->A[k][j] * x[order[j]];
        }
        x[order[k]] = sum / work->A[k][k];
    }
    return lw_finite(x, LW_UNKNOWNS) ? LW_OK : LW_NOT_FINITE;
}

lw_status lw_model_react(lw_model *model, lw_work *work)
{
    lw_real *values = model->values;
    const lw_real *q = model->closed_q, *w = model->closed_w, *dw = values + LW_AT_DW;
UNDRIVEN    const lw_real *u = values + LW_AT_U;
DRIVEN    lw_real u[LW_U + LW_Z];
    lw_status status;
WITHFREE    const lw_parameters given = lw_given(values), *p = &given;
DRIVEN    lw_join(values + LW_AT_U, values + LW_AT_Z, u);
    lw_balanced_code(q, w, dw, u WITH_P, work->K, work->right);
    status = lw_balance(work, work->right, work->x);
    if (status == LW_OK) {
        lw_shown_code(q, w, dw, u, work->x WITH_P, values + LW_AT_REACTIONS);
    }
    return status;
}

/* The change of the wrenches, behind that of the motion. */
static lw_status lw_reaction_tangent(
    const lw_model *model,
    lw_work *work,
    const lw_real *seeds,
    const lw_real *u,
    const lw_real *su,
    const lw_real *tq,
    const lw_real *tw TAKING_P,
    lw_real *found)
{
    const lw_real *values = model->values, *q = model->closed_q, *w = model->closed_w;
    const lw_real *dw = values + LW_AT_DW, *tdw = found + LW_AT_DW;
    const lw_real *sp = seeds + LW_AT_P;
    lw_real twrenches[LW_REACTIONS];
    lw_status status;
    int k;
    lw_balanced_code(q, w, dw, u WITH_P, work->K, work->right);
    status = lw_balance(work, work->right, work->x);
    if (status == LW_OK) {
        lw_change_code(q, w, dw, u, work->x, tq, tw, tdw, su, sp WITH_P, work->right, twrenches);
        status = lw_balance(work, work->right, work->x);
    }
    if (status == LW_OK) {
        lw_shown_code(q, w, dw, u, work->x WITH_P, found + LW_AT_REACTIONS);
        for (k = 0; k < LW_REACTIONS; ++k) {
            found[LW_AT_REACTIONS + k] += twrenches[k];
        }
    }
    return status;
}

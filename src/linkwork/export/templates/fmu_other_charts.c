/* The weakest pivot of the own chart. */
static lw_real lw_own_strength(const lw_real *q TAKING_P)
{
    const lw_real rest[LW_V] = {0};
    lw_real w[LW_W], pivot[1];
    lw_rates_code(q, rest WITH_P, w, pivot);
    return fabs(pivot[0]);
}

/* The weakest pivot of a choice of rates; of the best one without a choice. */
static lw_real lw_strength(const lw_real *q, const lw_chart *chart TAKING_P)
{
    lw_real phi[LW_PHI], Phi[LW_PHI * LW_W], gap[1], A[LW_PHI][LW_W + 1];
    int all[LW_W], rows[LW_W], columns[LW_W], k;
    for (k = 0; k < LW_W; ++k) {
        all[k] = 1;
    }
    lw_free_closure_code(q WITH_P, phi, Phi, gap);
    lw_scaled(Phi, phi, A);
    return lw_reduce(A, chart ? chart->is_dependent : all, rows, columns);
}

/* Whether the kept choice is weak: the own one is left where it is evaluated. */
static int lw_is_weak(const lw_model *model)
{
    const lw_real *q = model->closed_q;
    lw_chart kept;
WITHFREE    const lw_parameters given = lw_given(model->values), *p = &given;
    if (model->kept.own) {
        return 0;
    }
    lw_chosen(&model->kept, &kept);
    return lw_own_strength(q WITH_P) > LW_REUSED
        || lw_strength(q, &kept WITH_P) < LW_BETTER * lw_strength(q, 0 WITH_P);
}

/* Choose the independent rates anew where they are weak: the own ones where these are strong. */
static lw_status lw_choose_again(lw_model *model, int *is_new)
{
    lw_chart chart;
WITHFREE    const lw_parameters given = lw_given(model->values), *p = &given;
    *is_new = lw_is_weak(model);
    if (!*is_new) {
        return LW_OK;
    }
    lw_own_chart(&chart);
    if (!(lw_own_strength(model->closed_q WITH_P) > LW_REUSED)
        && !lw_best_chart(model->closed_q WITH_P, &chart)) {
        return LW_SINGULAR;
    }
    lw_choose(&chart, &model->kept);
    model->changes += 1;
    return LW_OK;
}

/* Solve Phi x = b for the dependent rates, the independent ones being given in x. */
static lw_status lw_dependent(
    const lw_chart *chart, const lw_real *Phi, const lw_real *b, lw_real *x)
{
    lw_real A[LW_PHI][LW_W + 1], rest[LW_PHI];
    int rows[LW_W], columns[LW_W], i, r;
    for (r = 0; r < LW_PHI; ++r) {
        rest[r] = b[r];
        for (i = 0; i < LW_V; ++i) {
            rest[r] -= Phi[r + LW_PHI * chart->independent[i]] * x[chart->independent[i]];
        }
    }
    lw_scaled(Phi, rest, A);
    if (!(lw_reduce(A, chart->is_dependent, rows, columns) > 0)) {
        return LW_SINGULAR;
    }
    for (i = 0; i < LW_W - LW_V; ++i) {
        x[columns[i]] = A[rows[i]][LW_W] * lw_rate_factors[columns[i]];
    }
    return LW_OK;
}

/* lambda with  Phi' lambda = r  on the dependent rates, zero of rows that depend on others. */
static lw_status lw_multipliers(
    const lw_chart *chart, const lw_real *Phi, const lw_real *r, lw_real *lambda)
{
    lw_real A[LW_PHI][LW_W + 1], B[LW_PHI][LW_W + 1];
    int rows[LW_W], columns[LW_W], own_rows[LW_W], own_columns[LW_W], allowed[LW_W], i, j;
    lw_scaled(Phi, Phi, A);
    if (!(lw_reduce(A, chart->is_dependent, rows, columns) > 0)) {
        return LW_SINGULAR;
    }
    lw_scaled(Phi, Phi, A);
    for (i = 0; i < LW_PHI; ++i) {
        lambda[i] = 0;
        for (j = 0; j <= LW_W; ++j) {
            B[i][j] = 0;
        }
    }
    for (i = 0; i < LW_W; ++i) {
        allowed[i] = i < LW_W - LW_V;
    }
    for (i = 0; i < LW_W - LW_V; ++i) {
        for (j = 0; j < LW_W - LW_V; ++j) {
            B[i][j] = A[rows[j]][columns[i]];
        }
        B[i][LW_W] = r[columns[i]] * lw_rate_factors[columns[i]];
    }
    if (!(lw_reduce(B, allowed, own_rows, own_columns) > 0)) {
        return LW_SINGULAR;
    }
    for (i = 0; i < LW_W - LW_V; ++i) {
        const int row = rows[own_columns[i]];
        lambda[row] = B[own_rows[i]][LW_W] * lw_row_factors[row];
    }
    return LW_OK;
}

/* Tangents of closed states and their motion in a chart that is not the own one. */
static lw_status lw_other_tangent(
    const lw_chart *chart,
    const lw_model *model,
    const lw_real *seeds,
    const lw_real *u,
    const lw_real *su TAKING_P,
    lw_real *tq,
    lw_real *tdq,
    lw_real *tw,
    lw_real *tdw TAKING_TDZ)
{
    const lw_real *q = model->closed_q, *w = model->closed_w;
    const lw_real *dw = model->values + LW_AT_DW, *sp = seeds + LW_AT_P;
    lw_real phi[LW_PHI], Phi[LW_PHI * LW_W], gap[1], t[LW_W], b[LW_PHI], L[LW_W][LW_V];
    lw_real dq[LW_Q], H[LW_W * LW_W], f[LW_W], gamma[LW_PHI], lambda[LW_PHI], r[LW_W];
    lw_real M[LW_V][LW_V], forces[LW_V];
DRIVEN    lw_real dz[LW_Z];
    lw_status status;
    int i, j, k, m;
    lw_free_closure_code(q WITH_P, phi, Phi, gap);
    if (!lw_other_map(chart, Phi, L)) {
        return LW_SINGULAR;
    }
    /* Closed coordinates:  Phi t = -phi_p sp,  tq = N t. */
    lw_free_opened_code(q, seeds + LW_AT_Q, sp WITH_P, t, b);
    for (i = 0; i < LW_PHI; ++i) {
        b[i] = -b[i];
    }
    status = lw_dependent(chart, Phi, b, t);
    if (status != LW_OK) {
        return status;
    }
    /* Rates:  Phi tw = -(change of Phi) w. */
    lw_free_turned_code(q, w, t, sp WITH_P, tq, b);
    for (i = 0; i < LW_PHI; ++i) {
        b[i] = -b[i];
    }
    lw_copy(LW_W, seeds + LW_AT_W, tw);
    status = lw_dependent(chart, Phi, b, tw);
    /* Multipliers of the motion:  Phi' lambda = f - H w'. */
    lw_free_forces_code(q, w, u WITH_P, dq, H, f, gamma WITH_DZ);
    for (i = 0; i < LW_W; ++i) {
        for (j = 0; j < LW_W; ++j) {
            f[i] -= H[i + LW_W * j] * dw[j];
        }
    }
    if (status == LW_OK) {
        status = lw_multipliers(chart, Phi, f, lambda);
    }
    if (status != LW_OK) {
        return status;
    }
    /* Accelerations:  L' (H tw' + r) = 0,  Phi tw' = -(change of Phi w' + gamma). */
    lw_free_tangent_code(q, w, u, dw, lambda, tq, tw, su, sp WITH_P, tdq, r, b WITH_TDZ);
    for (i = 0; i < LW_PHI; ++i) {
        b[i] = -b[i];
    }
    for (i = 0; i < LW_W; ++i) {
        tdw[i] = 0;
    }
    status = lw_dependent(chart, Phi, b, tdw);
    for (i = 0; i < LW_W; ++i) {
        for (j = 0; j < LW_W; ++j) {
            r[i] += H[i + LW_W * j] * tdw[j];
        }
    }
    for (k = 0; k < LW_V; ++k) {
        forces[k] = 0;
        for (m = 0; m < LW_V; ++m) {
            M[k][m] = 0;
        }
        for (i = 0; i < LW_W; ++i) {
            forces[k] -= L[i][k] * r[i];
            for (j = 0; j < LW_W; ++j) {
                for (m = 0; m < LW_V; ++m) {
                    M[k][m] += L[i][k] * H[i + LW_W * j] * L[j][m];
                }
            }
        }
    }
    if (status != LW_OK || !lw_solve(M, forces)) {
        return LW_SINGULAR;
    }
    lw_other_rates(L, forces, r);
    for (i = 0; i < LW_W; ++i) {
        tdw[i] += r[i];
    }
    return LW_OK;
}

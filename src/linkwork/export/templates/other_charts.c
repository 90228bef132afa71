/* Phi with a last column, free of units. */
static void lw_scaled(const lw_real *Phi, const lw_real *last, lw_real A[LW_PHI][LW_W + 1])
{
    int r, k;
    for (r = 0; r < LW_PHI; ++r) {
        for (k = 0; k < LW_W; ++k) {
            A[r][k] = Phi[r + LW_PHI * k] * lw_row_factors[r] * lw_rate_factors[k];
        }
        A[r][LW_W] = last[r] * lw_row_factors[r];
    }
}

/* Whether numbers of places are out of order by an odd number of exchanges. */
static int lw_is_odd(const int *places)
{
    int odd = 0, i, k;
    for (i = 0; i < LW_W - LW_V; ++i) {
        for (k = 0; k < i; ++k) {
            odd ^= places[k] > places[i];
        }
    }
    return odd;
}

/* Solve for the dependent rates by Gauss and Jordan's elimination with the strongest pivot each
   time, of the columns and rows that are allowed; return the weakest. In row rows[i] the rate
   columns[i] is left alone. side: of zero on which the determinant of the rows is. */
static lw_real lw_reduce_to(
    lw_real A[LW_PHI][LW_W + 1],
    const int *allowed,
    const int *kept,
    int *rows,
    int *columns,
    int *side)
{
    int taken_rows[LW_PHI], taken_columns[LW_W];
    lw_real weakest = (lw_real)INFINITY;
    int negative = 0, i, r, k;
    *side = 1;
    for (r = 0; r < LW_PHI; ++r) {
        taken_rows[r] = kept && !kept[r];
    }
    for (k = 0; k < LW_W; ++k) {
        taken_columns[k] = !allowed[k];
    }
    for (i = 0; i < LW_W - LW_V; ++i) {
        lw_real strongest = 0, inverse;
        rows[i] = columns[i] = 0;
        for (r = 0; r < LW_PHI; ++r) {
            for (k = 0; k < LW_W && !taken_rows[r]; ++k) {
                if (!taken_columns[k] && fabs(A[r][k]) > strongest) {
                    strongest = fabs(A[r][k]);
                    rows[i] = r;
                    columns[i] = k;
                }
            }
        }
        if (!(strongest > 0)) {
            return 0;
        }
        weakest = strongest < weakest ? strongest : weakest;
        taken_rows[rows[i]] = taken_columns[columns[i]] = 1;
        inverse = 1 / A[rows[i]][columns[i]];
        negative ^= inverse < 0;
        for (k = 0; k <= LW_W; ++k) {
            A[rows[i]][k] *= inverse;
        }
        for (r = 0; r < LW_PHI; ++r) {
            const lw_real factor = A[r][columns[i]];
            for (k = 0; k <= LW_W && r != rows[i]; ++k) {
                A[r][k] -= factor * A[rows[i]][k];
            }
        }
    }
    *side = negative ^ lw_is_odd(rows) ^ lw_is_odd(columns) ? -1 : 1;
    return weakest;
}

static lw_real lw_reduce(lw_real A[LW_PHI][LW_W + 1], const int *allowed, int *rows, int *columns)
{
    int side;
    return lw_reduce_to(A, allowed, 0, rows, columns, &side);
}

/* Choose the chart that is best at a configuration; tell whether it determines the motion. */
static int lw_best_chart(const lw_real *q TAKING_P, lw_chart *chart)
{
    lw_real phi[LW_PHI], Phi[LW_PHI * LW_W], gap[1], A[LW_PHI][LW_W + 1], weakest;
    int all[LW_W], rows[LW_W], columns[LW_W], count = 0, k;
    for (k = 0; k < LW_W; ++k) {
        all[k] = 1;
        chart->is_dependent[k] = 0;
    }
    for (k = 0; k < LW_PHI; ++k) {
        chart->is_kept[k] = 0;
    }
    lw_free_closure_code(q WITH_P, phi, Phi, gap);
    lw_scaled(Phi, phi, A);
    weakest = lw_reduce(A, all, rows, columns);
    for (k = 0; k < LW_W - LW_V; ++k) {
        chart->is_dependent[columns[k]] = 1;
        chart->is_kept[rows[k]] = 1;
    }
    for (k = 0; k < LW_W && count < LW_V; ++k) {
        if (!chart->is_dependent[k]) {
            chart->independent[count++] = k;
        }
    }
    chart->own = 0;
    return weakest > chart->least;
}

/* L of w = L v in a chart; tell whether it determines the motion. */
static int lw_other_map(const lw_chart *chart, const lw_real *Phi, lw_real L[LW_W][LW_V])
{
    lw_real A[LW_PHI][LW_W + 1];
    int rows[LW_W], columns[LW_W], i, k;
    lw_scaled(Phi, Phi, A);
    if (!(lw_reduce(A, chart->is_dependent, rows, columns) > chart->least)) {
        return 0;
    }
    for (k = 0; k < LW_V; ++k) {
        for (i = 0; i < LW_V; ++i) {
            L[chart->independent[i]][k] = i == k ? (lw_real)1 : (lw_real)0;
        }
        for (i = 0; i < LW_W - LW_V; ++i) {
            const int from = chart->independent[k];
            L[columns[i]][k]
                = -A[rows[i]][from] * lw_rate_factors[columns[i]] / lw_rate_factors[from];
        }
    }
    return 1;
}

static void lw_other_rates(lw_real L[LW_W][LW_V], const lw_real *v, lw_real *w)
{
    int i, k;
    for (i = 0; i < LW_W; ++i) {
        w[i] = 0;
        for (k = 0; k < LW_V; ++k) {
            w[i] += L[i][k] * v[k];
        }
    }
}

/* Solve M x = b in place of b for a symmetric M that is positive, by M = U' D U in its upper half;
   tell whether it is. */
static int lw_solve(lw_real M[LW_V][LW_V], lw_real *b)
{
    int i, j, k;
    for (i = 0; i < LW_V; ++i) {
        if (!(M[i][i] > 0)) {
            return 0;
        }
        for (j = i + 1; j < LW_V; ++j) {
            const lw_real factor = M[i][j] / M[i][i];
            for (k = j; k < LW_V; ++k) {
                M[j][k] -= factor * M[i][k];
            }
            b[j] -= factor * b[i];
        }
    }
    for (i = LW_V - 1; i >= 0; --i) {
        for (k = i + 1; k < LW_V; ++k) {
            b[i] -= M[i][k] * b[k];
        }
        b[i] /= M[i][i];
    }
    return 1;
}

/* y' and w' in a chart that is not the own one: L' H L v' = L' (f - H b), w' = L v' + b; pivot: the
   weakest, of one sign on either side of poses where it is singular. */
static lw_status lw_other_slope(
    const lw_chart *chart,
    const lw_real *y,
    const lw_real *u TAKING_P,
    lw_real *dy,
    lw_real *dw,
    lw_real *pivot)
{
    lw_real phi[LW_PHI], Phi[LW_PHI * LW_W], gap[1], gamma[LW_PHI], A[LW_PHI][LW_W + 1];
    lw_real L[LW_W][LW_V], w[LW_W], H[LW_W * LW_W], f[LW_W], b[LW_W], M[LW_V][LW_V];
    lw_real weakest;
    int rows[LW_W], columns[LW_W], side, i, j, k, m;
DRIVEN    lw_real *dz = dy + LW_Q + LW_V;
    lw_free_closure_code(y WITH_P, phi, Phi, gap);
    if (!lw_other_map(chart, Phi, L)) {
        return LW_SINGULAR;
    }
    lw_other_rates(L, y + LW_Q, w);
    lw_free_forces_code(y, w, u WITH_P, dy, H, f, gamma WITH_DZ);
    lw_scaled(Phi, gamma, A);
    weakest = lw_reduce_to(A, chart->is_dependent, chart->is_kept, rows, columns, &side);
    *pivot = (lw_real)side * weakest;
    for (i = 0; i < LW_W; ++i) {
        b[i] = 0;
    }
    for (i = 0; i < LW_W - LW_V; ++i) {
        b[columns[i]] = -A[rows[i]][LW_W] * lw_rate_factors[columns[i]];
    }
    for (i = 0; i < LW_W; ++i) {
        for (j = 0; j < LW_W; ++j) {
            f[i] -= H[i + LW_W * j] * b[j];
        }
    }
    for (k = 0; k < LW_V; ++k) {
        lw_real forces = 0;
        for (m = 0; m < LW_V; ++m) {
            M[k][m] = 0;
        }
        for (i = 0; i < LW_W; ++i) {
            lw_real row[LW_V];
            forces += L[i][k] * f[i];
            for (m = 0; m < LW_V; ++m) {
                row[m] = 0;
                for (j = 0; j < LW_W; ++j) {
                    row[m] += H[i + LW_W * j] * L[j][m];
                }
                M[k][m] += L[i][k] * row[m];
            }
        }
        dy[LW_Q + k] = forces;
    }
    if (!lw_solve(M, dy + LW_Q)) {
        return LW_NOT_FINITE;
    }
    lw_other_rates(L, dy + LW_Q, dw);
    for (i = 0; i < LW_W; ++i) {
        dw[i] += b[i];
    }
    return LW_OK;
}

/* Close the loops as lw_settle does, with the chart's independent coordinates as they are, from
   quaternions a Newton step nearer to length 1 on. */
static lw_real lw_other_settle(const lw_chart *chart, lw_real *q TAKING_P)
{
    lw_real at[LW_Q], next[LW_Q], phi[LW_PHI], Phi[LW_PHI * LW_W], s[LW_W], gap[1];
    lw_real A[LW_PHI][LW_W + 1], least = (lw_real)INFINITY;
    int rows[LW_W], columns[LW_W], i, k;
    for (i = 0; i < LW_W; ++i) {
        s[i] = 0;
    }
    lw_free_moved_code(q, s WITH_P, at);
    for (k = 0; k < LW_MOST_CORRECTIONS; ++k) {
        lw_free_closure_code(at WITH_P, phi, Phi, gap);
        if (!(gap[0] < least)) {
            break;
        }
        least = gap[0];
        lw_copy(LW_Q, at, q);
        if (least <= LW_CLOSED) {
            break;
        }
        lw_scaled(Phi, phi, A);
        if (!(lw_reduce(A, chart->is_dependent, rows, columns) > 0)) {
            break;
        }
        for (i = 0; i < LW_W; ++i) {
            s[i] = 0;
        }
        for (i = 0; i < LW_W - LW_V; ++i) {
            s[columns[i]] = -A[rows[i]][LW_W] * lw_rate_factors[columns[i]];
        }
        lw_free_moved_code(at, s WITH_P, next);
        lw_copy(LW_Q, next, at);
    }
    return least;
}

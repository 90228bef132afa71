static void lw_copy(int count, const lw_real *from, lw_real *to)
{
    int k;
    for (k = 0; k < count; ++k) {
        to[k] = from[k];
    }
}

static int lw_finite(const lw_real *x, int count)
{
    int k;
    lw_real nothing = 0;
    for (k = 0; k < count; ++k) {
        nothing = LW_FMA(0, x[k], nothing);
    }
    return nothing == 0;
}

static lw_status lw_judged(lw_real pivot, const lw_real *found, int count)
{
    if (!(fabs(pivot) > LW_PIVOT_BOUND)) {
        return LW_SINGULAR;
    }
    return lw_finite(found, count) ? LW_OK : LW_NOT_FINITE;
}

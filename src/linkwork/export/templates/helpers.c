static lw_status lw_judged(lw_real pivot, const lw_real *found, int count)
{
    int k;
    if (!(fabs(pivot) > LW_PIVOT_BOUND)) {
        return LW_SINGULAR;
    }
    for (k = 0; k < count; ++k) {
        if (!(found[k] - found[k] == 0)) {
            return LW_NOT_FINITE;
        }
    }
    return LW_OK;
}

static void lw_turn(
    int n,
    const lw_real *LW_RESTRICT x,
    lw_real *LW_RESTRICT s,
    lw_real *LW_RESTRICT c)
{
    int j, k;
    lw_real squares = 0;
    for (k = 0; k < n; ++k) {
        squares = LW_FMA(x[k], x[k], squares);
    }
    for (k = 0; k < n; k += LW_TOGETHER) {
        for (j = k; j < k + LW_TOGETHER; ++j) {
TURNED
        }
    }
    if (!(squares <= LW_LARGEST_ANGLE * LW_LARGEST_ANGLE)) {
        lw_turn_far(n, x, s, c);
    }
}

static void lw_turn_one(
    const lw_real *LW_RESTRICT x,
    lw_real *LW_RESTRICT s,
    lw_real *LW_RESTRICT c)
{
    const int j = 0;
TURNED
    if (!(fabs(x[0]) <= LW_LARGEST_ANGLE)) {
        lw_turn_far(1, x, s, c);
    }
}

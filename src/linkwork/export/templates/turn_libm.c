static void lw_turn(int n, const lw_real *x, lw_real *s, lw_real *c)
{
    int k;
    for (k = 0; k < n; ++k) {
        s[k] = sin(x[k]);
        c[k] = cos(x[k]);
    }
}

#ifdef LW_ONE_ROUNDING
#define LW_LARGEST_ANGLE BOUND_WITH_FMA
#else
#define LW_LARGEST_ANGLE BOUND_WITHOUT_FMA
#endif

static void lw_turn(int n, const lw_real *x, lw_real *s, lw_real *c)
{
    int k, far = 0;
    for (k = 0; k < n; ++k) {
        far |= !(fabs(x[k]) <= LW_LARGEST_ANGLE);
    }
    for (k = 0; k < n; ++k) {
        const lw_real shifted = LW_FMA(x[k], PER_QUARTER, ROUND);
        const lw_real quarters = shifted - ROUND;
        const lw_real halves = LW_FMA(quarters, HALF, ROUND) - ROUND;
        const lw_real fourths = LW_FMA(halves, HALF, ROUND) - ROUND;
        const lw_real odd = quarters - 2 * halves;
        const lw_real odd_half = halves - 2 * fourths;
        const lw_real even = 1 - odd * odd - 2 * odd_half * odd_half;
#ifdef LW_ONE_ROUNDING
REDUCTION_WITH_FMA
#else
REDUCTION_WITHOUT_FMA
#endif
        const lw_real z = r * r;
        const lw_real cube = z * r;
        const lw_real sine = LW_FMA(cube, SINE_POLYNOMIAL, r);
        const lw_real cosine = LW_FMA(z, COSINE_POLYNOMIAL, 1);
        s[k] = LW_FMA(cosine, odd, sine * even);
        c[k] = LW_FMA(-sine, odd, cosine * even);
    }
    for (k = 0; far && k < n; ++k) {
        if (!(fabs(x[k]) <= LW_LARGEST_ANGLE)) {
            s[k] = sin(x[k]);
            c[k] = cos(x[k]);
        }
    }
}

#ifdef LW_ONE_ROUNDING
#define LW_LARGEST_ANGLE BOUND_WITH_FMA
#else
#define LW_LARGEST_ANGLE BOUND_WITHOUT_FMA
#endif

static void lw_turn(int n, const lw_real *x, lw_real *s, lw_real *c)
{
    int k, far = 0;
    for (k = 0; k < n; ++k) {
        const lw_real near_x = fabs(x[k]) <= LW_LARGEST_ANGLE ? x[k] : 0;
        const lw_real shifted = LW_FMA(near_x, PER_QUARTER, ROUND);
        const lw_real quarters = shifted - ROUND;
#ifdef LW_ONE_ROUNDING
REDUCTION_WITH_FMA
#else
REDUCTION_WITHOUT_FMA
#endif
        const lw_real z = r * r;
        const lw_real cube = z * r;
        const lw_real sine = LW_FMA(cube, SINE_POLYNOMIAL, r);
        const lw_real cosine = LW_FMA(z, COSINE_POLYNOMIAL, 1);
        const int32_t quadrant = (int32_t)quarters;
        const int odd = (quadrant & 1) != 0;
        const lw_real half_turn = (quadrant & 2) != 0 ? (lw_real)-1 : (lw_real)1;
        s[k] = (odd ? cosine : sine) * half_turn;
        c[k] = (odd ? -sine : cosine) * half_turn;
        far |= !(fabs(x[k]) <= LW_LARGEST_ANGLE);
    }
    for (k = 0; far && k < n; ++k) {
        if (!(fabs(x[k]) <= LW_LARGEST_ANGLE)) {
            s[k] = sin(x[k]);
            c[k] = cos(x[k]);
        }
    }
}

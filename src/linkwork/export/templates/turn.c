#ifdef LW_ONE_ROUNDING
#define LW_LARGEST_ANGLE BOUND_WITH_FMA
#else
#define LW_LARGEST_ANGLE BOUND_WITHOUT_FMA
#endif

/* Angles that are taken together where the processor has vectors; arrays are as long as whole
   ones. */
#if defined(__AVX__)
#define LW_TOGETHER TOGETHER
#elif defined(__SSE2__) || defined(__aarch64__)
#define LW_TOGETHER 2
#else
#define LW_TOGETHER 1
#endif

/* What is hardly ever needed stays out of the way. */
#if defined(__GNUC__)
#define LW_SELDOM __attribute__((noinline, cold))
#else
#define LW_SELDOM
#endif

LW_SELDOM
static void lw_turn_far(int n, const lw_real *x, lw_real *s, lw_real *c)
{
    int k;
    for (k = 0; k < n; ++k) {
        if (!(fabs(x[k]) <= LW_LARGEST_ANGLE)) {
            s[k] = sin(x[k]);
            c[k] = cos(x[k]);
        }
    }
}

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
            const lw_real shifted = LW_FMA(x[j], PER_QUARTER, ROUND);
            const lw_real quarters = shifted - ROUND;
            const lw_real turns = LW_FMA(quarters, QUARTER, ROUND) - ROUND;
            const lw_real rest = LW_FMA(-4, turns, quarters);
            const lw_real even = 1 - fabs(rest);
            const lw_real odd = LW_FMA(rest, even, rest);
#ifdef LW_ONE_ROUNDING
REDUCTION_WITH_FMA
#else
REDUCTION_WITHOUT_FMA
#endif
            const lw_real z = r * r;
            const lw_real cube = z * r;
            const lw_real sine = LW_FMA(cube, SINE_POLYNOMIAL, r);
            const lw_real cosine = LW_FMA(z, COSINE_POLYNOMIAL, 1);
            s[j] = LW_FMA(cosine, odd, sine * even);
            c[j] = LW_FMA(-sine, odd, cosine * even);
        }
    }
    if (!(squares <= LW_LARGEST_ANGLE * LW_LARGEST_ANGLE)) {
        lw_turn_far(n, x, s, c);
    }
}

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

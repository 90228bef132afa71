/* Without the rules of IEEE 754 what is not finite is not told, and sines are wrong. */
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(_M_FP_FAST) \
    || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "compile without -ffast-math, /fp:fast and the like: numbers would be wrong"
#endif

/* Products and sums are rounded once, as in the library that this was written by, where the
   processor does so as quickly. With LW_SAME_NUMBERS they are everywhere, if slowly. */
#if defined(LW_SAME_NUMBERS) || defined(FP_FAST_FMA) || defined(__FMA__) \
    || defined(__ARM_FEATURE_FMA) || defined(__aarch64__)
#define LW_ONE_ROUNDING
#define LW_FMA(a, b, c) fma(a, b, c)
#else
#define LW_FMA(a, b, c) ((a) * (b) + (c))
#endif

#if !defined(__cplusplus) && defined(__STDC_VERSION__) && __STDC_VERSION__ >= 199901L
#define LW_RESTRICT restrict
#else
#define LW_RESTRICT
#endif

/* Functions that are carried out one after the other stay apart: in short ones more values are in
   registers. */
#if defined(__GNUC__)
#define LW_SEPARATE __attribute__((noinline))
#else
#define LW_SEPARATE
#endif

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

/* The free numbers among the values. */
static lw_parameters lw_given(const lw_real *values)
{
    lw_parameters given;
    memcpy(&given, values + LW_AT_P, sizeof given);
    return given;
}

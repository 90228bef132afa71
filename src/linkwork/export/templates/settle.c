/* Go on by Newton's steps of the dependent coordinates as long as each brings the loops nearer;
   return the gap that is left. */
static lw_real lw_settle(lw_real *q TAKING_P)
{
    lw_real at[LW_Q], next[LW_Q], gap[1], length[1], pivot[1], least = (lw_real)INFINITY;
    int k;
    lw_copy(LW_Q, q, at);
    for (k = 0; k < LW_MOST_CORRECTIONS; ++k) {
        lw_closing_code(at WITH_P, next, gap, length, pivot);
        if (!(gap[0] < least)) {
            break;
        }
        least = gap[0];
        lw_copy(LW_Q, at, q);
        if (least <= LW_CLOSED) {
            break;
        }
        lw_copy(LW_Q, next, at);
    }
    return least;
}

#define LW_DRIFTED ((lw_real)1e-3) /* gap of states that an event closes */
#define LW_FARTHEST ((lw_real)0.02) /* that closing the loops moves a coordinate, in own units */
#define LW_BETTER ((lw_real)0.5) /* strength of a choice, over that of the best, that is weak */

static void lw_chosen(const lw_choice *from, lw_chart *to)
{
    int k;
    to->own = from->own;
OTHERWISE    to->least = LW_LOST;
    for (k = 0; k < LW_V; ++k) {
        to->independent[k] = from->independent[k];
    }
    for (k = 0; k < LW_W; ++k) {
        to->is_dependent[k] = from->is_dependent[k];
    }
OTHERWISE    for (k = 0; k < LW_PHI; ++k) {
OTHERWISE        to->is_kept[k] = 1;
OTHERWISE    }
}

static void lw_choose(const lw_chart *from, lw_choice *to)
{
    int k;
    to->own = from->own;
    for (k = 0; k < LW_V; ++k) {
        to->independent[k] = from->independent[k];
    }
    for (k = 0; k < LW_W; ++k) {
        to->is_dependent[k] = from->own ? 0 : from->is_dependent[k];
    }
}

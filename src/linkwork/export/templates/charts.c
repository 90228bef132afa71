/* What is integrated: y = (q, v), with the rates v that are independent in a chart: the robot's own
   ones, or others where these hardly determine the motion. */
#define LW_Y (LW_Q + LW_V PLUS_Z)

typedef struct lw_chart {
    int own;
    int independent[LW_V];
    int is_dependent[LW_W];
OTHERWISE    int is_kept[LW_PHI]; /* of rows by which the side of its singular poses is told */
OTHERWISE    lw_real least; /* pivot down to which others determine the motion */
} lw_chart;

static void lw_own_chart(lw_chart *chart)
{
    int k;
    chart->own = 1;
OTHERWISE    chart->least = LW_LOST;
    for (k = 0; k < LW_V; ++k) {
        chart->independent[k] = lw_v_places[k];
    }
}
DRIVEN
DRIVEN /* What programs take as u: the commands, and the states of drives. */
DRIVEN static void lw_join(const lw_real *commands, const lw_real *z, lw_real *u)
DRIVEN {
DRIVEN    lw_copy(LW_U, commands, u);
DRIVEN    lw_copy(LW_Z, z, u + LW_U);
DRIVEN }

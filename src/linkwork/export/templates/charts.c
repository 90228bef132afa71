/* What is integrated: y = (q, v), with the rates v that are independent in a chart: the robot's own
   ones, or others where these hardly determine the motion. */
#define LW_Y (LW_Q + LW_V)

typedef struct lw_chart {
    int own;
    int independent[LW_V];
    int is_dependent[LW_W];
} lw_chart;

static void lw_own_chart(lw_chart *chart)
{
    int k;
    chart->own = 1;
    for (k = 0; k < LW_V; ++k) {
        chart->independent[k] = lw_v_places[k];
    }
}

/* Compare what the functions of LW_FILE.h give with the numbers that Linkwork found; the exit
   status is the number of functions that do not. */
#include "LW_FILE.h"

#include <math.h>
#include <stdio.h>

#define TOLERANCE SELFTEST_TOLERANCE

GOLDEN

static double magnitude(double x)
{
    return x < 0.0 ? -x : x;
}

/* Return the largest difference over the largest number, which may not be beyond the tolerance. */
static double difference(lw_status status, const lw_real *found, const lw_real *wanted, int count)
{
    double largest = 0.0, worst = 0.0;
    int k;
    if (status != LW_OK) {
        return (double)INFINITY;
    }
    for (k = 0; k < count; ++k) {
        const double size = magnitude((double)wanted[k]);
        const double apart = magnitude((double)found[k] - (double)wanted[k]);
        largest = size > largest ? size : largest;
        worst = apart > worst || apart != apart ? apart : worst;
    }
    return largest > 1e-9 ? worst / largest : worst;
}

static int told(const char *name, double worst)
{
    printf("%-20s largest difference %.1e %s\n", name, worst, worst <= TOLERANCE ? "" : "WRONG");
    return worst <= TOLERANCE ? 0 : 1;
}

int main(void)
{
    int wrong = 0, k;
    double worst, one;
CHECKS
    return wrong;
}

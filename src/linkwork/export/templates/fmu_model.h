/* The model of an FMU: plain data that may be copied, and what is done with it. */
#ifndef LW_MODEL_H
#define LW_MODEL_H

#include <stdint.h>

#include "LW_FILE.h"

/* Where the numbers of each kind begin among the values; these places are the value references. */
enum {
PLACES
};

/* Continuous states: q, w, and the states of drives. */
#define LW_STATES (LW_Q + LW_W PLUS_Z)

/* A choice of independent rates: the own ones of the robot, or others. */
typedef struct lw_choice {
    int32_t own;
    int32_t independent[LW_V];
    int32_t is_dependent[LW_W];
} lw_choice;

/* kept: the choice of independent rates; moved: it was made anew, or a number was set by which the
   loops may be open; known: all values belong to the states */
typedef struct lw_model {
    lw_real values[LW_VALUES];
    lw_real closed_q[LW_Q];
    lw_real closed_w[LW_W];
    lw_real rtol;
    lw_real next;
    lw_choice kept;
    int32_t start_at_tool;
    int32_t changes;
    int32_t moved;
    int32_t known;
} lw_model;

/* What reactions are found with: rooms that last no longer than a call. */
typedef struct lw_work {
    lw_real K[LW_FILLED + 1];
    lw_real A[LW_UNKNOWNS + 1][LW_UNKNOWNS + 1];
    lw_real right[LW_UNKNOWNS + 1];
    lw_real x[LW_UNKNOWNS + 1];
} lw_work;

/* Start values of all that is set, and the states at home. */
void lw_model_reset(lw_model *model);

/* Find the states at which a motion begins, from the start values. */
lw_status lw_model_begin(lw_model *model);

/* Find derivatives, outputs and event indicators. */
lw_status lw_model_evaluate(lw_model *model);

/* Whether the independent rates are a weak choice, or the states have come apart from closed loops,
   so that an event is due; what was evaluated before. */
int lw_model_is_due(const lw_model *model);

/* Choose the independent rates anew where that is due, and close the loops; tell whether the states
   changed. */
lw_status lw_model_event(lw_model *model, int *changed);

/* Make a step of the co-simulation, with as many of its own as the tolerance needs; where it fails
   the states are where it came to. */
lw_status lw_model_step(lw_model *model, lw_real dt);

/* Find the wrenches in the joints, where they are told; what was evaluated before. */
lw_status lw_model_react(lw_model *model, lw_work *work);

/* found: change of every value along seeds of all values, of which those of inputs, parameters and
   states count; what was evaluated before. */
lw_status lw_model_tangent(
    const lw_model *model, lw_work *work, const lw_real *seeds, lw_real *found);

/* What is typical of each state's size. */
void lw_model_nominals(lw_real *nominals);

#endif

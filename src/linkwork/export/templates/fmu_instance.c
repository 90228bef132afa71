#include "LW_FILE_instance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LW_TOKEN "INSTANTIATION_TOKEN"
#define LW_LONGEST_TEXT 1024

static const char *const lw_names[LW_VALUES] = {
NAMES
};

static const lw_real lw_least[LW_VALUES] = LEAST_VALUES;

/* A saved instance; its token tells whose it is. */
typedef struct lw_saved {
    char token[sizeof LW_TOKEN];
    int32_t mode;
    lw_model model;
} lw_saved;

static const char *lw_meaning(lw_status status)
{
    static const char *const meanings[] = {
MEANINGS
    };
    return meanings[status];
}

lw_instance *lw_new(
    const char *name, const char *token, int is_me, lw_told told, void *callback)
{
    const char *const own = name ? name : "";
    lw_instance *instance = calloc(1, sizeof *instance);
    if (!instance) {
        return 0;
    }
    instance->name = calloc(strlen(own) + 1, 1);
    if (!instance->name) {
        free(instance);
        return 0;
    }
    memcpy(instance->name, own, strlen(own));
    instance->told = told;
    instance->callback = callback;
    instance->is_me = is_me;
    instance->mode = LW_INSTANTIATED;
    lw_model_reset(&instance->model);
    if (!token || strcmp(token, LW_TOKEN) != 0) {
        lw_fails(
            instance,
            LW_FMI_ERROR,
            "the model description belongs to another FMU; it gives the token",
            token ? token : "(none)");
        lw_free(instance);
        return 0;
    }
    return instance;
}

void lw_free(lw_instance *instance)
{
    if (instance) {
        free(instance->name);
        free(instance);
    }
}

int lw_fails(lw_instance *instance, int status, const char *text, const char *of)
{
    char whole[LW_LONGEST_TEXT];
    snprintf(whole, sizeof whole, "%s%s%s", text, of && *of ? " " : "", of ? of : "");
    if (instance->told) {
        instance->told(instance->callback, instance->name, status, whole);
    }
    return status;
}

int lw_allowed(lw_instance *instance, int modes, const char *function)
{
    if (instance && (instance->mode & modes)) {
        return 1;
    }
    if (instance) {
        lw_fails(instance, LW_FMI_ERROR, "is called where it is not allowed:", function);
    }
    return 0;
}

/* What a status of the model is to an importer: what shorter steps may cure is discarded. */
static int lw_outcome(lw_instance *instance, lw_status status, const char *where)
{
    return status == LW_OK ? LW_FMI_OK
                           : lw_fails(instance, LW_FMI_DISCARD, where, lw_meaning(status));
}

static int lw_begins(lw_instance *instance)
{
    lw_model *model = &instance->model;
    const lw_status status = lw_model_begin(model);
    if (status == LW_OK) {
        return LW_FMI_OK;
    }
    return lw_fails(
        instance,
        LW_FMI_ERROR,
        model->start_at_tool ? "no motion begins at the tool's pose of start_tool:"
                             : "no motion begins at the coordinates and rates of start:",
        lw_meaning(status));
}

int lw_set_categories(lw_instance *instance, size_t count, const char *const *categories)
{
    size_t k;
    for (k = 0; k < count; ++k) {
        const char *const each = categories ? categories[k] : 0;
        if (!each
            || (strcmp(each, "logStatusError") != 0 && strcmp(each, "logStatusDiscard") != 0)) {
            return lw_fails(instance, LW_FMI_ERROR, "there is no category of messages", each);
        }
    }
    return LW_FMI_OK;
}

int lw_none(lw_instance *instance, size_t count)
{
    return count == 0 ? LW_FMI_OK
                      : lw_fails(instance, LW_FMI_ERROR, "there is no variable of this kind", "");
}

int lw_has_size(lw_instance *instance, size_t count, size_t wanted)
{
    if (count == wanted) {
        return 1;
    }
    lw_fails(instance, LW_FMI_ERROR, "an array has another length than what it is for", "");
    return 0;
}

int lw_set_up(lw_instance *instance, int has_tolerance, double tolerance, double start)
{
    if (has_tolerance && !(tolerance > 0 && tolerance < 1)) {
        return lw_fails(instance, LW_FMI_ERROR, "the tolerance is not between 0 and 1", "");
    }
    if (!(start - start == 0)) {
        return lw_fails(instance, LW_FMI_ERROR, "the start time is not finite", "");
    }
    if (has_tolerance) {
        instance->model.rtol = tolerance;
    }
    instance->model.values[LW_AT_TIME] = start;
    return LW_FMI_OK;
}

/* Bring all values up to date; before the start these are the ones of the start. */
static int lw_known(lw_instance *instance)
{
    lw_model *model = &instance->model;
    if (model->known) {
        return LW_FMI_OK;
    }
    if (instance->mode & (LW_INSTANTIATED | LW_INITIALIZATION)) {
        const int status = lw_begins(instance);
        if (status != LW_FMI_OK) {
            return status;
        }
    }
    if (!instance->is_me && model->moved) {
        int changed;
        return lw_outcome(
            instance,
            lw_model_event(model, &changed),
            "the loops do not close with these numbers:");
    }
    return lw_outcome(instance, lw_model_evaluate(model), "the states have no motion:");
}

int lw_exit_initialization(lw_instance *instance)
{
    int status;
    instance->model.known = 0;
    status = lw_known(instance);
    if (status != LW_FMI_OK) {
        instance->mode = LW_FAILED;
        return LW_FMI_ERROR;
    }
    instance->mode = instance->is_me ? LW_EVENT : LW_STEP;
    return LW_FMI_OK;
}

int lw_reset(lw_instance *instance)
{
    lw_model_reset(&instance->model);
    instance->mode = LW_INSTANTIATED;
    return LW_FMI_OK;
}

int lw_get(lw_instance *instance, const uint32_t *places, size_t count, double *values)
{
    size_t k;
    int status = LW_FMI_OK;
REACTING    int are_known = 0;
    for (k = 0; k < count; ++k) {
        if (places[k] >= LW_VALUES) {
            return lw_fails(instance, LW_FMI_ERROR, "there is no number of this reference", "");
        }
        if (places[k] >= LW_AT_Q && status == LW_FMI_OK) {
            status = lw_known(instance);
        }
REACTING        if (places[k] >= LW_AT_REACTIONS && status == LW_FMI_OK && !are_known) {
REACTING            status = lw_outcome(
REACTING                instance,
REACTING                lw_model_react(&instance->model, &instance->work),
REACTING                "there are no reactions:");
REACTING            are_known = 1;
REACTING        }
        values[k] = instance->model.values[places[k]];
    }
    return status;
}

/* Which values may be set where the instance stands. */
static int lw_is_settable(const lw_instance *instance, uint32_t place)
{
    if (place < LW_AT_U) {
        return 0;
    }
    if (place < LW_AT_P) {
        return instance->mode != LW_TERMINATED;
    }
    if (place < LW_AT_START) {
        return (instance->mode & (LW_INSTANTIATED | LW_INITIALIZATION | LW_EVENT | LW_STEP)) != 0;
    }
    return place < LW_AT_Q && (instance->mode & (LW_INSTANTIATED | LW_INITIALIZATION)) != 0;
}

int lw_set(lw_instance *instance, const uint32_t *places, size_t count, const double *values)
{
    lw_model *model = &instance->model;
    size_t k;
    for (k = 0; k < count; ++k) {
        if (places[k] >= LW_VALUES) {
            return lw_fails(instance, LW_FMI_ERROR, "there is no number of this reference", "");
        }
        if (!lw_is_settable(instance, places[k])) {
            return lw_fails(instance, LW_FMI_ERROR, "cannot be set now:", lw_names[places[k]]);
        }
        if (!(values[k] - values[k] == 0)) {
            return lw_fails(
                instance, LW_FMI_DISCARD, "keeps its value, for another is not finite:",
                lw_names[places[k]]);
        }
        if (values[k] < lw_least[places[k]]) {
            return lw_fails(
                instance, LW_FMI_DISCARD, "keeps its value, for another is below its least:",
                lw_names[places[k]]);
        }
    }
    for (k = 0; k < count; ++k) {
        model->moved |= places[k] >= LW_AT_P;
        model->values[places[k]] = values[k];
        model->known = 0;
    }
    return LW_FMI_OK;
}

int lw_get_switch(lw_instance *instance, uint32_t place, int *value)
{
    if (place != LW_AT_START_AT_TOOL) {
        return lw_fails(instance, LW_FMI_ERROR, "there is no truth of this reference", "");
    }
    *value = instance->model.start_at_tool;
    return LW_FMI_OK;
}

int lw_set_switch(lw_instance *instance, uint32_t place, int value)
{
    if (place != LW_AT_START_AT_TOOL) {
        return lw_fails(instance, LW_FMI_ERROR, "there is no truth of this reference", "");
    }
    if (!(instance->mode & (LW_INSTANTIATED | LW_INITIALIZATION))) {
        return lw_fails(instance, LW_FMI_ERROR, "cannot be set now: start_at_tool", "");
    }
    instance->model.start_at_tool = value != 0;
    instance->model.known = 0;
    return LW_FMI_OK;
}

int lw_set_time(lw_instance *instance, double time)
{
    if (!(time - time == 0)) {
        return lw_fails(instance, LW_FMI_DISCARD, "the time is not finite", "");
    }
    instance->model.values[LW_AT_TIME] = time;
    return LW_FMI_OK;
}

int lw_set_states(lw_instance *instance, const double *states, size_t count)
{
    size_t k;
    if (!lw_has_size(instance, count, LW_STATES)) {
        return LW_FMI_ERROR;
    }
    for (k = 0; k < count; ++k) {
        if (!(states[k] - states[k] == 0)) {
            return lw_fails(
                instance, LW_FMI_DISCARD, "keeps its value, for another is not finite:",
                lw_names[LW_AT_Q + k]);
        }
    }
    memcpy(instance->model.values + LW_AT_Q, states, count * sizeof *states);
    instance->model.known = 0;
    return LW_FMI_OK;
}

int lw_get_part(lw_instance *instance, int first, int size, double *values, size_t count)
{
    const int status = lw_known(instance);
    if (!lw_has_size(instance, count, (size_t)size)) {
        return LW_FMI_ERROR;
    }
    memcpy(values, instance->model.values + first, count * sizeof *values);
    return status;
}

int lw_get_nominals(lw_instance *instance, double *values, size_t count)
{
    if (!lw_has_size(instance, count, LW_STATES)) {
        return LW_FMI_ERROR;
    }
    lw_model_nominals(values);
    return LW_FMI_OK;
}

int lw_update(lw_instance *instance, int *changed)
{
    return lw_outcome(
        instance, lw_model_event(&instance->model, changed), "no motion goes on from this event:");
}

int lw_completed(lw_instance *instance, int *is_due)
{
    const int status = lw_known(instance);
    *is_due = status == LW_FMI_OK && lw_model_is_due(&instance->model);
    return status;
}

int lw_do_step(lw_instance *instance, double begin, double length)
{
    lw_model *model = &instance->model;
    lw_status status;
    if (!(length >= 0 && length - length == 0) || !(begin - begin == 0)) {
        return lw_fails(
            instance, LW_FMI_ERROR, "a step needs a time and a length that are finite", "");
    }
    model->values[LW_AT_TIME] = begin;
    if (!(length > 0)) {
        return LW_FMI_OK;
    }
    status = lw_model_step(model, length);
    if (status != LW_OK) {
        return lw_outcome(instance, status, "the step ends before its time:");
    }
    model->values[LW_AT_TIME] = begin + length;
    return LW_FMI_OK;
}

int lw_derivative(
    lw_instance *instance,
    const uint32_t *unknowns,
    size_t unknown_count,
    const uint32_t *knowns,
    size_t known_count,
    const double *seeds,
    double *found)
{
    double all[LW_VALUES] = {0}, tangent[LW_VALUES];
    int status = lw_known(instance);
    size_t k;
    for (k = 0; k < known_count; ++k) {
        const uint32_t place = knowns[k];
        if (!(place < LW_AT_START || (place >= LW_AT_Q && place < LW_AT_DQ))) {
            return lw_fails(
                instance,
                LW_FMI_ERROR,
                "no derivative is known along",
                place < LW_VALUES ? lw_names[place] : "a number that there is not");
        }
        all[place] += seeds[k];
    }
    if (status != LW_FMI_OK) {
        return status;
    }
    status = lw_outcome(
        instance,
        lw_model_tangent(&instance->model, &instance->work, all, tangent),
        "there is no derivative:");
    for (k = 0; k < unknown_count; ++k) {
        if (unknowns[k] >= LW_VALUES) {
            return lw_fails(instance, LW_FMI_ERROR, "there is no number of this reference", "");
        }
        found[k] = tangent[unknowns[k]];
    }
    return status;
}

int lw_save(lw_instance *instance, void **saved)
{
    lw_saved *own = *saved;
    if (!own) {
        own = calloc(1, sizeof *own);
    }
    if (!own) {
        return lw_fails(instance, LW_FMI_ERROR, "there is no memory to save the state", "");
    }
    memcpy(own->token, LW_TOKEN, sizeof own->token);
    own->mode = (int32_t)instance->mode;
    own->model = instance->model;
    *saved = own;
    return LW_FMI_OK;
}

int lw_restore(lw_instance *instance, const void *saved)
{
    const lw_saved *own = saved;
    if (!own) {
        return lw_fails(instance, LW_FMI_ERROR, "no state was saved", "");
    }
    instance->mode = (int)own->mode;
    instance->model = own->model;
    return LW_FMI_OK;
}

int lw_forget(void **saved)
{
    if (saved) {
        free(*saved);
        *saved = 0;
    }
    return LW_FMI_OK;
}

size_t lw_saved_size(void)
{
    return sizeof(lw_saved);
}

int lw_write(lw_instance *instance, const void *saved, void *bytes, size_t size)
{
    if (!saved || size < sizeof(lw_saved)) {
        return lw_fails(instance, LW_FMI_ERROR, "the bytes have no room for the state", "");
    }
    memcpy(bytes, saved, sizeof(lw_saved));
    return LW_FMI_OK;
}

int lw_read(lw_instance *instance, const void *bytes, size_t size, void **saved)
{
    lw_saved *own;
    if (size != sizeof *own || memcmp(bytes, LW_TOKEN, sizeof LW_TOKEN) != 0) {
        return lw_fails(instance, LW_FMI_ERROR, "the bytes hold no state of this FMU", "");
    }
    own = calloc(1, sizeof *own);
    if (!own) {
        return lw_fails(instance, LW_FMI_ERROR, "there is no memory to read the state", "");
    }
    memcpy(own, bytes, sizeof *own);
    *saved = own;
    return LW_FMI_OK;
}

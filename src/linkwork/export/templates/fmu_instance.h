/* An instance of an FMU: a model, where it stands in its life, and whom it tells what goes
   wrong. */
#ifndef LW_INSTANCE_H
#define LW_INSTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "LW_FILE_model.h"

#if defined(_WIN32)
#define LW_EXPORTED __declspec(dllexport)
#elif defined(__GNUC__)
#define LW_EXPORTED __attribute__((visibility("default")))
#else
#define LW_EXPORTED
#endif

/* What a function returns: the numbers are those of FMI 2 and of FMI 3. */
enum { LW_FMI_OK = 0, LW_FMI_WARNING = 1, LW_FMI_DISCARD = 2, LW_FMI_ERROR = 3 };

/* Where an instance stands, as bits. */
enum {
    LW_INSTANTIATED = 1,
    LW_INITIALIZATION = 2,
    LW_EVENT = 4,
    LW_CONTINUOUS = 8,
    LW_STEP = 16,
    LW_TERMINATED = 32,
    LW_FAILED = 64,
    LW_STARTED = LW_EVENT | LW_CONTINUOUS | LW_STEP,
    LW_SEEN = LW_INITIALIZATION | LW_STARTED | LW_TERMINATED,
    LW_ANY = 127
};

typedef void (*lw_told)(void *callback, const char *name, int status, const char *text);

typedef struct lw_instance {
    lw_model model;
    lw_work work;
    int is_me;
    int mode;
    char *name;
    lw_told told;
    void *callback;
} lw_instance;

/* Null where the token is another one, or there is no memory. */
lw_instance *lw_new(
    const char *name, const char *token, int is_me, lw_told told, void *callback);
void lw_free(lw_instance *instance);

/* Tell whether a function may be called now. */
int lw_allowed(lw_instance *instance, int modes, const char *function);

/* Tell what went wrong, and return the status. */
int lw_fails(lw_instance *instance, int status, const char *text, const char *of);

/* Refuse categories of messages that there are not; what is told goes wrong and is always told. */
int lw_set_categories(lw_instance *instance, size_t count, const char *const *categories);

/* Of variables of kinds that there are none of: right where none is asked for. */
int lw_none(lw_instance *instance, size_t count);
int lw_has_size(lw_instance *instance, size_t count, size_t wanted);

int lw_set_up(lw_instance *instance, int has_tolerance, double tolerance, double start);
int lw_exit_initialization(lw_instance *instance);
int lw_reset(lw_instance *instance);

int lw_get(lw_instance *instance, const uint32_t *places, size_t count, double *values);
int lw_set(lw_instance *instance, const uint32_t *places, size_t count, const double *values);
int lw_get_switch(lw_instance *instance, uint32_t place, int *value);
int lw_set_switch(lw_instance *instance, uint32_t place, int value);

int lw_set_time(lw_instance *instance, double time);
int lw_set_states(lw_instance *instance, const double *states, size_t count);
int lw_get_part(lw_instance *instance, int first, int size, double *values, size_t count);
int lw_get_nominals(lw_instance *instance, double *values, size_t count);
int lw_update(lw_instance *instance, int *changed);
int lw_completed(lw_instance *instance, int *is_due);
int lw_do_step(lw_instance *instance, double begin, double length);

int lw_derivative(
    lw_instance *instance,
    const uint32_t *unknowns,
    size_t unknown_count,
    const uint32_t *knowns,
    size_t known_count,
    const double *seeds,
    double *found);

int lw_save(lw_instance *instance, void **saved);
int lw_restore(lw_instance *instance, const void *saved);
int lw_forget(void **saved);
size_t lw_saved_size(void);
int lw_write(lw_instance *instance, const void *saved, void *bytes, size_t size);
int lw_read(lw_instance *instance, const void *bytes, size_t size, void **saved);

#endif

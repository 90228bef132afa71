/* An importer of FMI 3.0 that is not FMPy: a co-simulation with constant inputs, its end printed.

   importer LIBRARY TOKEN STEPS LENGTH INPUTS (REFERENCE VALUE)... OUTPUTS REFERENCE... */
#ifdef _WIN32
#include <windows.h>
#define dlopen(name, mode) LoadLibraryA(name)
#define dlsym(library, name) (void *)GetProcAddress(library, name)
#define dlerror() "the library does not load"
#else
#include <dlfcn.h>
#endif
#include <stdio.h>
#include <stdlib.h>

#include "fmi3Functions.h"

#define MOST 256

static void *library;

static void *found(const char *name)
{
    void *const function = dlsym(library, name);
    if (!function) {
        fprintf(stderr, "no function %s\n", name);
        exit(2);
    }
    return function;
}

static void told(
    fmi3InstanceEnvironment of, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)of;
    fprintf(stderr, "%d %s: %s\n", (int)status, category, message);
}

static void check(fmi3Status status, const char *what)
{
    if (status != fmi3OK) {
        fprintf(stderr, "%s: status %d\n", what, (int)status);
        exit(3);
    }
}

#define CALL(name, ...) check(((name##TYPE *)found(#name))(__VA_ARGS__), #name)

int main(int count, char **words)
{
    const int steps = atoi(words[3]), inputs = atoi(words[5]);
    const double length = atof(words[4]);
    fmi3ValueReference references[MOST];
    double values[MOST];
    fmi3Instance instance;
    int k, outputs = 0, next = 6;
    library = dlopen(words[1], RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    instance = ((fmi3InstantiateCoSimulationTYPE *)found("fmi3InstantiateCoSimulation"))(
        "one", words[2], "", false, false, false, false, NULL, 0, NULL, told, NULL);
    if (!instance) {
        return 4;
    }
    CALL(fmi3EnterInitializationMode, instance, true, 1e-9, 0.0, false, 0.0);
    for (k = 0; k < inputs; ++k) {
        references[0] = (fmi3ValueReference)atoi(words[next++]);
        values[0] = atof(words[next++]);
        CALL(fmi3SetFloat64, instance, references, 1, values, 1);
    }
    CALL(fmi3ExitInitializationMode, instance);
    for (k = 0; k < steps; ++k) {
        fmi3Boolean event, end, early;
        double last;
        CALL(fmi3DoStep, instance, k * length, length, true, &event, &end, &early, &last);
    }
    while (next < count && outputs < MOST) {
        references[outputs++] = (fmi3ValueReference)atoi(words[next++]);
    }
    CALL(fmi3GetFloat64, instance, references, (size_t)outputs, values, (size_t)outputs);
    for (k = 0; k < outputs; ++k) {
        printf("%.17g\n", values[k]);
    }
    CALL(fmi3Terminate, instance);
    ((fmi3FreeInstanceTYPE *)found("fmi3FreeInstance"))(instance);
    return 0;
}

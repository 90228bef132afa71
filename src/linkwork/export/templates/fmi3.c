#include "fmi3.h"

#include <stdlib.h>
#include <string.h>

#include "LW_FILE_instance.h"

/* Begin a function: refuse to be called where it may not be. */
#define LW_CALLED(modes, name) \
    lw_instance *const own = instance; \
    if (!lw_allowed(own, modes, name)) \
        return fmi3Error

LW_EXPORTED const char *fmi3GetVersion(void)
{
    return "3.0";
}

/* How an instance of FMI 3 tells: the function is a part of it, for data and functions are no
   pointers of one kind. */
typedef struct lw_fmi3_callback {
    fmi3LogMessageCallback function;
    fmi3InstanceEnvironment environment;
} lw_fmi3_callback;

static void lw_fmi3_told(void *of, const char *name, int status, const char *text)
{
    const lw_fmi3_callback *const callback = of;
    if (callback->function) {
        callback->function(
            callback->environment,
            (fmi3Status)status,
            status == LW_FMI_DISCARD ? "logStatusDiscard" : "logStatusError",
            text);
    }
}

static fmi3Instance lw_fmi3_new(
    fmi3String instanceName,
    fmi3String instantiationToken,
    int is_me,
    fmi3Boolean loggingOn,
    fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback logMessage)
{
    lw_fmi3_callback *const callback = malloc(sizeof *callback);
    lw_instance *own;
    if (!callback) {
        return 0;
    }
    callback->function = logMessage;
    callback->environment = environment;
    own = lw_new(instanceName, instantiationToken, is_me, lw_fmi3_told, callback);
    if (!own) {
        free(callback);
        return 0;
    }
    return own;
}

LW_EXPORTED fmi3Status fmi3SetDebugLogging(
    fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[])
{
    LW_CALLED(LW_ANY, "fmi3SetDebugLogging");
    return (fmi3Status)lw_set_categories(own, nCategories, categories);
}

LW_EXPORTED fmi3Instance fmi3InstantiateModelExchange(
    fmi3String instanceName,
    fmi3String instantiationToken,
    fmi3String resourcePath,
    fmi3Boolean visible,
    fmi3Boolean loggingOn,
    fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage)
{
    return lw_fmi3_new(
        instanceName, instantiationToken, 1, loggingOn, instanceEnvironment, logMessage);
}

LW_EXPORTED fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName,
    fmi3String instantiationToken,
    fmi3String resourcePath,
    fmi3Boolean visible,
    fmi3Boolean loggingOn,
    fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed,
    const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables,
    fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    if (eventModeUsed || nRequiredIntermediateVariables > 0) {
        if (logMessage) {
            logMessage(
                instanceEnvironment,
                fmi3Error,
                "logStatusError",
                "the co-simulation has no event mode and no intermediate variables");
        }
        return 0;
    }
    return lw_fmi3_new(
        instanceName, instantiationToken, 0, loggingOn, instanceEnvironment, logMessage);
}

LW_EXPORTED fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName,
    fmi3String instantiationToken,
    fmi3String resourcePath,
    fmi3Boolean visible,
    fmi3Boolean loggingOn,
    fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage,
    fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    if (logMessage) {
        logMessage(
            instanceEnvironment,
            fmi3Error,
            "logStatusError",
            "there is no scheduled execution; take model exchange or co-simulation");
    }
    return 0;
}

LW_EXPORTED void fmi3FreeInstance(fmi3Instance instance)
{
    lw_instance *const own = instance;
    if (own) {
        free(own->callback);
        lw_free(own);
    }
}

LW_EXPORTED fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance,
    fmi3Boolean toleranceDefined,
    fmi3Float64 tolerance,
    fmi3Float64 startTime,
    fmi3Boolean stopTimeDefined,
    fmi3Float64 stopTime)
{
    LW_CALLED(LW_INSTANTIATED, "fmi3EnterInitializationMode");
    int status;
    status = lw_set_up(own, toleranceDefined, tolerance, startTime);
    own->mode = status == LW_FMI_OK ? LW_INITIALIZATION : own->mode;
    return (fmi3Status)status;
}

LW_EXPORTED fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    LW_CALLED(LW_INITIALIZATION, "fmi3ExitInitializationMode");
    return (fmi3Status)lw_exit_initialization(own);
}

LW_EXPORTED fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    LW_CALLED(LW_EVENT | LW_CONTINUOUS, "fmi3EnterEventMode");
    own->mode = LW_EVENT;
    return fmi3OK;
}

LW_EXPORTED fmi3Status fmi3Terminate(fmi3Instance instance)
{
    LW_CALLED(LW_STARTED, "fmi3Terminate");
    own->mode = LW_TERMINATED;
    return fmi3OK;
}

LW_EXPORTED fmi3Status fmi3Reset(fmi3Instance instance)
{
    LW_CALLED(LW_ANY, "fmi3Reset");
    return (fmi3Status)lw_reset(own);
}

LW_EXPORTED fmi3Status fmi3GetFloat64(
    fmi3Instance instance,
    const fmi3ValueReference valueReferences[],
    size_t nValueReferences,
    fmi3Float64 values[],
    size_t nValues)
{
    LW_CALLED(LW_ANY, "fmi3GetFloat64");
    if (!lw_has_size(own, nValues, nValueReferences)) {
        return fmi3Error;
    }
    return (fmi3Status)lw_get(own, valueReferences, nValueReferences, values);
}

LW_EXPORTED fmi3Status fmi3SetFloat64(
    fmi3Instance instance,
    const fmi3ValueReference valueReferences[],
    size_t nValueReferences,
    const fmi3Float64 values[],
    size_t nValues)
{
    LW_CALLED(LW_ANY, "fmi3SetFloat64");
    if (!lw_has_size(own, nValues, nValueReferences)) {
        return fmi3Error;
    }
    return (fmi3Status)lw_set(own, valueReferences, nValueReferences, values);
}

LW_EXPORTED fmi3Status fmi3GetBoolean(
    fmi3Instance instance,
    const fmi3ValueReference valueReferences[],
    size_t nValueReferences,
    fmi3Boolean values[],
    size_t nValues)
{
    LW_CALLED(LW_ANY, "fmi3GetBoolean");
    size_t k;
    int status = LW_FMI_OK, value = 0;
    if (!lw_has_size(own, nValues, nValueReferences)) {
        return fmi3Error;
    }
    for (k = 0; k < nValues && status == LW_FMI_OK; ++k) {
        status = lw_get_switch(own, valueReferences[k], &value);
        values[k] = value != 0;
    }
    return (fmi3Status)status;
}

LW_EXPORTED fmi3Status fmi3SetBoolean(
    fmi3Instance instance,
    const fmi3ValueReference valueReferences[],
    size_t nValueReferences,
    const fmi3Boolean values[],
    size_t nValues)
{
    LW_CALLED(LW_ANY, "fmi3SetBoolean");
    size_t k;
    int status = LW_FMI_OK;
    if (!lw_has_size(own, nValues, nValueReferences)) {
        return fmi3Error;
    }
    for (k = 0; k < nValues && status == LW_FMI_OK; ++k) {
        status = lw_set_switch(own, valueReferences[k], values[k]);
    }
    return (fmi3Status)status;
}

LW_EXPORTED fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    LW_CALLED(LW_ANY, "fmi3GetFMUState");
    return (fmi3Status)lw_save(own, FMUState);
}

LW_EXPORTED fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    LW_CALLED(LW_ANY, "fmi3SetFMUState");
    return (fmi3Status)lw_restore(own, FMUState);
}

LW_EXPORTED fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    LW_CALLED(LW_ANY, "fmi3FreeFMUState");
    return (fmi3Status)lw_forget(FMUState);
}

LW_EXPORTED fmi3Status fmi3SerializedFMUStateSize(
    fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    LW_CALLED(LW_ANY, "fmi3SerializedFMUStateSize");
    *size = lw_saved_size();
    return fmi3OK;
}

LW_EXPORTED fmi3Status fmi3SerializeFMUState(
    fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    LW_CALLED(LW_ANY, "fmi3SerializeFMUState");
    return (fmi3Status)lw_write(own, FMUState, serializedState, size);
}

LW_EXPORTED fmi3Status fmi3DeserializeFMUState(
    fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState)
{
    LW_CALLED(LW_ANY, "fmi3DeserializeFMUState");
    return (fmi3Status)lw_read(own, serializedState, size, FMUState);
}

LW_EXPORTED fmi3Status fmi3GetDirectionalDerivative(
    fmi3Instance instance,
    const fmi3ValueReference unknowns[],
    size_t nUnknowns,
    const fmi3ValueReference knowns[],
    size_t nKnowns,
    const fmi3Float64 seed[],
    size_t nSeed,
    fmi3Float64 sensitivity[],
    size_t nSensitivity)
{
    LW_CALLED(LW_SEEN, "fmi3GetDirectionalDerivative");
    if (!lw_has_size(own, nSeed, nKnowns) || !lw_has_size(own, nSensitivity, nUnknowns)) {
        return fmi3Error;
    }
    return (fmi3Status)lw_derivative(
        own, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity);
}

LW_EXPORTED fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    LW_CALLED(LW_INITIALIZATION | LW_EVENT, "fmi3EvaluateDiscreteStates");
    return fmi3OK;
}

LW_EXPORTED fmi3Status fmi3UpdateDiscreteStates(
    fmi3Instance instance,
    fmi3Boolean *discreteStatesNeedUpdate,
    fmi3Boolean *terminateSimulation,
    fmi3Boolean *nominalsOfContinuousStatesChanged,
    fmi3Boolean *valuesOfContinuousStatesChanged,
    fmi3Boolean *nextEventTimeDefined,
    fmi3Float64 *nextEventTime)
{
    LW_CALLED(LW_EVENT, "fmi3UpdateDiscreteStates");
    int changed = 0;
    const int status = lw_update(own, &changed);
    *discreteStatesNeedUpdate = fmi3False;
    *terminateSimulation = fmi3False;
    *nominalsOfContinuousStatesChanged = fmi3False;
    *valuesOfContinuousStatesChanged = changed != 0;
    *nextEventTimeDefined = fmi3False;
    *nextEventTime = 0;
    return (fmi3Status)status;
}

/* Model exchange. */

LW_EXPORTED fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    LW_CALLED(LW_EVENT, "fmi3EnterContinuousTimeMode");
    own->mode = LW_CONTINUOUS;
    return fmi3OK;
}

LW_EXPORTED fmi3Status fmi3CompletedIntegratorStep(
    fmi3Instance instance,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean *enterEventMode,
    fmi3Boolean *terminateSimulation)
{
    LW_CALLED(LW_CONTINUOUS, "fmi3CompletedIntegratorStep");
    int is_due = 0;
    const int status = lw_completed(own, &is_due);
    *enterEventMode = is_due != 0;
    *terminateSimulation = fmi3False;
    return (fmi3Status)status;
}

LW_EXPORTED fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    LW_CALLED(LW_EVENT | LW_CONTINUOUS, "fmi3SetTime");
    return (fmi3Status)lw_set_time(own, time);
}

LW_EXPORTED fmi3Status fmi3SetContinuousStates(
    fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    LW_CALLED(LW_EVENT | LW_CONTINUOUS, "fmi3SetContinuousStates");
    return (fmi3Status)lw_set_states(own, continuousStates, nContinuousStates);
}

LW_EXPORTED fmi3Status fmi3GetContinuousStateDerivatives(
    fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates)
{
    LW_CALLED(LW_SEEN, "fmi3GetContinuousStateDerivatives");
    return (fmi3Status)lw_get_part(
        own, LW_AT_DQ, LW_STATES, derivatives, nContinuousStates);
}

LW_EXPORTED fmi3Status fmi3GetEventIndicators(
    fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators)
{
    LW_CALLED(LW_SEEN, "fmi3GetEventIndicators");
    return (fmi3Status)lw_get_part(own, LW_AT_APART, LW_APART, eventIndicators, nEventIndicators);
}

LW_EXPORTED fmi3Status fmi3GetContinuousStates(
    fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    LW_CALLED(LW_SEEN, "fmi3GetContinuousStates");
    return (fmi3Status)lw_get_part(
        own, LW_AT_Q, LW_STATES, continuousStates, nContinuousStates);
}

LW_EXPORTED fmi3Status fmi3GetNominalsOfContinuousStates(
    fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates)
{
    LW_CALLED(LW_ANY, "fmi3GetNominalsOfContinuousStates");
    return (fmi3Status)lw_get_nominals(own, nominals, nContinuousStates);
}

LW_EXPORTED fmi3Status fmi3GetNumberOfEventIndicators(
    fmi3Instance instance, size_t *nEventIndicators)
{
    LW_CALLED(LW_ANY, "fmi3GetNumberOfEventIndicators");
    *nEventIndicators = LW_APART;
    return fmi3OK;
}

LW_EXPORTED fmi3Status fmi3GetNumberOfContinuousStates(
    fmi3Instance instance, size_t *nContinuousStates)
{
    LW_CALLED(LW_ANY, "fmi3GetNumberOfContinuousStates");
    *nContinuousStates = LW_STATES;
    return fmi3OK;
}

/* Co-simulation. */

LW_EXPORTED fmi3Status fmi3DoStep(
    fmi3Instance instance,
    fmi3Float64 currentCommunicationPoint,
    fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean *eventHandlingNeeded,
    fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn,
    fmi3Float64 *lastSuccessfulTime)
{
    LW_CALLED(LW_STEP, "fmi3DoStep");
    const int status = lw_do_step(own, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = own->model.values[LW_AT_TIME];
    return (fmi3Status)status;
}

/* Functions of kinds of variables that there are none of: right where none is asked for. */
#define LW_NONE(name, ...) \
    LW_EXPORTED fmi3Status name( \
        fmi3Instance instance, \
        const fmi3ValueReference valueReferences[], \
        size_t nValueReferences, \
        __VA_ARGS__) \
    { \
        LW_CALLED(LW_ANY, #name); \
        return (fmi3Status)lw_none(own, nValueReferences); \
    }

LW_NONE(fmi3GetFloat32, fmi3Float32 values[], size_t nValues)
LW_NONE(fmi3SetFloat32, const fmi3Float32 values[], size_t nValues)
LW_NONE(fmi3GetInt8, fmi3Int8 values[], size_t nValues)
LW_NONE(fmi3SetInt8, const fmi3Int8 values[], size_t nValues)
LW_NONE(fmi3GetUInt8, fmi3UInt8 values[], size_t nValues)
LW_NONE(fmi3SetUInt8, const fmi3UInt8 values[], size_t nValues)
LW_NONE(fmi3GetInt16, fmi3Int16 values[], size_t nValues)
LW_NONE(fmi3SetInt16, const fmi3Int16 values[], size_t nValues)
LW_NONE(fmi3GetUInt16, fmi3UInt16 values[], size_t nValues)
LW_NONE(fmi3SetUInt16, const fmi3UInt16 values[], size_t nValues)
LW_NONE(fmi3GetInt32, fmi3Int32 values[], size_t nValues)
LW_NONE(fmi3SetInt32, const fmi3Int32 values[], size_t nValues)
LW_NONE(fmi3GetUInt32, fmi3UInt32 values[], size_t nValues)
LW_NONE(fmi3SetUInt32, const fmi3UInt32 values[], size_t nValues)
LW_NONE(fmi3GetInt64, fmi3Int64 values[], size_t nValues)
LW_NONE(fmi3SetInt64, const fmi3Int64 values[], size_t nValues)
LW_NONE(fmi3GetUInt64, fmi3UInt64 values[], size_t nValues)
LW_NONE(fmi3SetUInt64, const fmi3UInt64 values[], size_t nValues)
LW_NONE(fmi3GetString, fmi3String values[], size_t nValues)
LW_NONE(fmi3SetString, const fmi3String values[], size_t nValues)
LW_NONE(fmi3GetBinary, size_t valueSizes[], fmi3Binary values[], size_t nValues)
LW_NONE(fmi3SetBinary, const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
LW_NONE(fmi3GetClock, fmi3Clock values[])
LW_NONE(fmi3SetClock, const fmi3Clock values[])
LW_NONE(fmi3GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
LW_NONE(
    fmi3GetIntervalFraction,
    fmi3UInt64 counters[],
    fmi3UInt64 resolutions[],
    fmi3IntervalQualifier qualifiers[])
LW_NONE(fmi3GetShiftDecimal, fmi3Float64 shifts[])
LW_NONE(fmi3GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
LW_NONE(fmi3SetIntervalDecimal, const fmi3Float64 intervals[])
LW_NONE(fmi3SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
LW_NONE(fmi3SetShiftDecimal, const fmi3Float64 shifts[])
LW_NONE(fmi3SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
LW_NONE(fmi3GetOutputDerivatives, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)

/* Functions of what this FMU does not have. */
#define LW_ABSENT(name, ...) \
    LW_EXPORTED fmi3Status name(__VA_ARGS__) \
    { \
        LW_CALLED(LW_ANY, #name); \
        return (fmi3Status)lw_fails(own, LW_FMI_ERROR, "is not provided:", #name); \
    }

LW_ABSENT(
    fmi3GetNumberOfVariableDependencies,
    fmi3Instance instance,
    fmi3ValueReference valueReference,
    size_t *nDependencies)
LW_ABSENT(
    fmi3GetVariableDependencies,
    fmi3Instance instance,
    fmi3ValueReference dependent,
    size_t elementIndicesOfDependent[],
    fmi3ValueReference independents[],
    size_t elementIndicesOfIndependents[],
    fmi3DependencyKind dependencyKinds[],
    size_t nDependencies)
LW_ABSENT(
    fmi3GetAdjointDerivative,
    fmi3Instance instance,
    const fmi3ValueReference unknowns[],
    size_t nUnknowns,
    const fmi3ValueReference knowns[],
    size_t nKnowns,
    const fmi3Float64 seed[],
    size_t nSeed,
    fmi3Float64 sensitivity[],
    size_t nSensitivity)
LW_ABSENT(fmi3EnterConfigurationMode, fmi3Instance instance)
LW_ABSENT(fmi3ExitConfigurationMode, fmi3Instance instance)
LW_ABSENT(fmi3EnterStepMode, fmi3Instance instance)
LW_ABSENT(
    fmi3ActivateModelPartition,
    fmi3Instance instance,
    fmi3ValueReference clockReference,
    fmi3Float64 activationTime)

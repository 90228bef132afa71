#include "fmi2.h"

#include <stdint.h>
#include <string.h>

#include "LW_FILE_instance.h"

/* Begin a function: refuse to be called where it may not be. */
#define LW_CALLED(modes, name) \
    lw_instance *const own = c; \
    if (!lw_allowed(own, modes, name)) \
        return fmi2Error

LW_EXPORTED const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

LW_EXPORTED const char *fmi2GetVersion(void)
{
    return "2.0";
}

/* Messages are formats to the logger: a percent sign stands twice. */
static void lw_fmi2_told(void *of, const char *name, int status, const char *text)
{
    const fmi2CallbackFunctions *const callbacks = of;
    char whole[2048];
    size_t from, to = 0;
    if (!callbacks || !callbacks->logger) {
        return;
    }
    for (from = 0; text[from] && to + 2 < sizeof whole; ++from) {
        whole[to++] = text[from];
        if (text[from] == '%') {
            whole[to++] = '%';
        }
    }
    whole[to] = 0;
    callbacks->logger(
        callbacks->componentEnvironment,
        name,
        (fmi2Status)status,
        status == LW_FMI_DISCARD ? "logStatusDiscard" : "logStatusError",
        whole);
}

LW_EXPORTED fmi2Status fmi2SetDebugLogging(
    fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    LW_CALLED(LW_ANY, "fmi2SetDebugLogging");
    return (fmi2Status)lw_set_categories(own, nCategories, categories);
}

LW_EXPORTED fmi2Component fmi2Instantiate(
    fmi2String instanceName,
    fmi2Type fmuType,
    fmi2String fmuGUID,
    fmi2String fmuResourceLocation,
    const fmi2CallbackFunctions *functions,
    fmi2Boolean visible,
    fmi2Boolean loggingOn)
{
    lw_instance *own;
    own = lw_new(
        instanceName,
        fmuGUID,
        fmuType == fmi2ModelExchange,
        lw_fmi2_told,
        (void *)(uintptr_t)functions);
    return own;
}

LW_EXPORTED void fmi2FreeInstance(fmi2Component c)
{
    lw_free(c);
}

LW_EXPORTED fmi2Status fmi2SetupExperiment(
    fmi2Component c,
    fmi2Boolean toleranceDefined,
    fmi2Real tolerance,
    fmi2Real startTime,
    fmi2Boolean stopTimeDefined,
    fmi2Real stopTime)
{
    LW_CALLED(LW_INSTANTIATED, "fmi2SetupExperiment");
    return (fmi2Status)lw_set_up(own, toleranceDefined, tolerance, startTime);
}

LW_EXPORTED fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    LW_CALLED(LW_INSTANTIATED, "fmi2EnterInitializationMode");
    own->mode = LW_INITIALIZATION;
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    LW_CALLED(LW_INITIALIZATION, "fmi2ExitInitializationMode");
    return (fmi2Status)lw_exit_initialization(own);
}

LW_EXPORTED fmi2Status fmi2Terminate(fmi2Component c)
{
    LW_CALLED(LW_STARTED, "fmi2Terminate");
    own->mode = LW_TERMINATED;
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2Reset(fmi2Component c)
{
    LW_CALLED(LW_ANY, "fmi2Reset");
    return (fmi2Status)lw_reset(own);
}

LW_EXPORTED fmi2Status fmi2GetReal(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    LW_CALLED(LW_ANY, "fmi2GetReal");
    return (fmi2Status)lw_get(own, vr, nvr, value);
}

LW_EXPORTED fmi2Status fmi2SetReal(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    LW_CALLED(LW_ANY, "fmi2SetReal");
    return (fmi2Status)lw_set(own, vr, nvr, value);
}

LW_EXPORTED fmi2Status fmi2GetBoolean(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    LW_CALLED(LW_ANY, "fmi2GetBoolean");
    size_t k;
    int status = LW_FMI_OK;
    for (k = 0; k < nvr && status == LW_FMI_OK; ++k) {
        status = lw_get_switch(own, vr[k], &value[k]);
    }
    return (fmi2Status)status;
}

LW_EXPORTED fmi2Status fmi2SetBoolean(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    LW_CALLED(LW_ANY, "fmi2SetBoolean");
    size_t k;
    int status = LW_FMI_OK;
    for (k = 0; k < nvr && status == LW_FMI_OK; ++k) {
        status = lw_set_switch(own, vr[k], value[k]);
    }
    return (fmi2Status)status;
}

LW_EXPORTED fmi2Status fmi2GetInteger(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    LW_CALLED(LW_ANY, "fmi2GetInteger");
    return (fmi2Status)lw_none(own, nvr);
}

LW_EXPORTED fmi2Status fmi2SetInteger(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    LW_CALLED(LW_ANY, "fmi2SetInteger");
    return (fmi2Status)lw_none(own, nvr);
}

LW_EXPORTED fmi2Status fmi2GetString(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    LW_CALLED(LW_ANY, "fmi2GetString");
    return (fmi2Status)lw_none(own, nvr);
}

LW_EXPORTED fmi2Status fmi2SetString(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    LW_CALLED(LW_ANY, "fmi2SetString");
    return (fmi2Status)lw_none(own, nvr);
}

LW_EXPORTED fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    LW_CALLED(LW_ANY, "fmi2GetFMUstate");
    return (fmi2Status)lw_save(own, FMUstate);
}

LW_EXPORTED fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    LW_CALLED(LW_ANY, "fmi2SetFMUstate");
    return (fmi2Status)lw_restore(own, FMUstate);
}

LW_EXPORTED fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    LW_CALLED(LW_ANY, "fmi2FreeFMUstate");
    return (fmi2Status)lw_forget(FMUstate);
}

LW_EXPORTED fmi2Status fmi2SerializedFMUstateSize(
    fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    LW_CALLED(LW_ANY, "fmi2SerializedFMUstateSize");
    *size = lw_saved_size();
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2SerializeFMUstate(
    fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    LW_CALLED(LW_ANY, "fmi2SerializeFMUstate");
    return (fmi2Status)lw_write(own, FMUstate, serializedState, size);
}

LW_EXPORTED fmi2Status fmi2DeSerializeFMUstate(
    fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate)
{
    LW_CALLED(LW_ANY, "fmi2DeSerializeFMUstate");
    return (fmi2Status)lw_read(own, serializedState, size, FMUstate);
}

LW_EXPORTED fmi2Status fmi2GetDirectionalDerivative(
    fmi2Component c,
    const fmi2ValueReference vUnknown_ref[],
    size_t nUnknown,
    const fmi2ValueReference vKnown_ref[],
    size_t nKnown,
    const fmi2Real dvKnown[],
    fmi2Real dvUnknown[])
{
    LW_CALLED(LW_SEEN, "fmi2GetDirectionalDerivative");
    return (fmi2Status)lw_derivative(
        own, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown);
}

/* Model exchange. */

LW_EXPORTED fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    LW_CALLED(LW_EVENT | LW_CONTINUOUS, "fmi2EnterEventMode");
    own->mode = LW_EVENT;
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    LW_CALLED(LW_EVENT, "fmi2NewDiscreteStates");
    int changed = 0;
    const int status = lw_update(own, &changed);
    info->newDiscreteStatesNeeded = 0;
    info->terminateSimulation = 0;
    info->nominalsOfContinuousStatesChanged = 0;
    info->valuesOfContinuousStatesChanged = changed;
    info->nextEventTimeDefined = 0;
    info->nextEventTime = 0;
    return (fmi2Status)status;
}

LW_EXPORTED fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    LW_CALLED(LW_EVENT, "fmi2EnterContinuousTimeMode");
    own->mode = LW_CONTINUOUS;
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2CompletedIntegratorStep(
    fmi2Component c,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint,
    fmi2Boolean *enterEventMode,
    fmi2Boolean *terminateSimulation)
{
    LW_CALLED(LW_CONTINUOUS, "fmi2CompletedIntegratorStep");
    *terminateSimulation = 0;
    return (fmi2Status)lw_completed(own, enterEventMode);
}

LW_EXPORTED fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    LW_CALLED(LW_EVENT | LW_CONTINUOUS, "fmi2SetTime");
    return (fmi2Status)lw_set_time(own, time);
}

LW_EXPORTED fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    LW_CALLED(LW_EVENT | LW_CONTINUOUS, "fmi2SetContinuousStates");
    return (fmi2Status)lw_set_states(own, x, nx);
}

LW_EXPORTED fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    LW_CALLED(LW_SEEN, "fmi2GetDerivatives");
    return (fmi2Status)lw_get_part(own, LW_AT_DQ, LW_STATES, derivatives, nx);
}

LW_EXPORTED fmi2Status fmi2GetEventIndicators(
    fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    LW_CALLED(LW_SEEN, "fmi2GetEventIndicators");
    return (fmi2Status)lw_get_part(own, LW_AT_APART, LW_APART, eventIndicators, ni);
}

LW_EXPORTED fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    LW_CALLED(LW_SEEN, "fmi2GetContinuousStates");
    return (fmi2Status)lw_get_part(own, LW_AT_Q, LW_STATES, x, nx);
}

LW_EXPORTED fmi2Status fmi2GetNominalsOfContinuousStates(
    fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    LW_CALLED(LW_ANY, "fmi2GetNominalsOfContinuousStates");
    return (fmi2Status)lw_get_nominals(own, x_nominal, nx);
}

/* Co-simulation. */

LW_EXPORTED fmi2Status fmi2SetRealInputDerivatives(
    fmi2Component c,
    const fmi2ValueReference vr[],
    size_t nvr,
    const fmi2Integer order[],
    const fmi2Real value[])
{
    LW_CALLED(LW_ANY, "fmi2SetRealInputDerivatives");
    return (fmi2Status)lw_none(own, nvr);
}

LW_EXPORTED fmi2Status fmi2GetRealOutputDerivatives(
    fmi2Component c,
    const fmi2ValueReference vr[],
    size_t nvr,
    const fmi2Integer order[],
    fmi2Real value[])
{
    LW_CALLED(LW_ANY, "fmi2GetRealOutputDerivatives");
    return (fmi2Status)lw_none(own, nvr);
}

LW_EXPORTED fmi2Status fmi2DoStep(
    fmi2Component c,
    fmi2Real currentCommunicationPoint,
    fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    LW_CALLED(LW_STEP, "fmi2DoStep");
    return (fmi2Status)lw_do_step(own, currentCommunicationPoint, communicationStepSize);
}

LW_EXPORTED fmi2Status fmi2CancelStep(fmi2Component c)
{
    LW_CALLED(LW_ANY, "fmi2CancelStep");
    return (fmi2Status)lw_fails(own, LW_FMI_ERROR, "steps end before they return", "");
}

LW_EXPORTED fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    LW_CALLED(LW_ANY, "fmi2GetStatus");
    *value = fmi2OK;
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    LW_CALLED(LW_ANY, "fmi2GetRealStatus");
    if (s != fmi2LastSuccessfulTime) {
        return (fmi2Status)lw_fails(own, LW_FMI_ERROR, "this status is no number", "");
    }
    *value = own->model.values[LW_AT_TIME];
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2GetIntegerStatus(
    fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    LW_CALLED(LW_ANY, "fmi2GetIntegerStatus");
    return (fmi2Status)lw_fails(own, LW_FMI_ERROR, "no status is a whole number", "");
}

LW_EXPORTED fmi2Status fmi2GetBooleanStatus(
    fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    LW_CALLED(LW_ANY, "fmi2GetBooleanStatus");
    if (s != fmi2Terminated) {
        return (fmi2Status)lw_fails(own, LW_FMI_ERROR, "this status is no truth", "");
    }
    *value = 0;
    return fmi2OK;
}

LW_EXPORTED fmi2Status fmi2GetStringStatus(
    fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    LW_CALLED(LW_ANY, "fmi2GetStringStatus");
    *value = "";
    return fmi2OK;
}

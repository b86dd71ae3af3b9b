/* FMI $fmi.0 co-simulation around the plant of $name.h. A value reference counts doubles of an
 * instance. Inputs are held during a step; FMI 2.0 may give their slopes for the next one. */
#include "$name.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define FMI $fmi

enum { OK, ERROR = 3 };

typedef struct {
    double time, command[${name}_commands], reading[${name}_readings];
    $name plant;
    double slope[${name}_commands];
} instance;

static int reset(instance *it) {
    memset(it, 0, sizeof *it);
    ${name}_start(&it->plant);
    memcpy(it->command, it->plant.state + $command, sizeof it->command);
    ${name}_read(&it->plant, it->reading);
    return OK;
}

static void *instantiate(const char *token) {
    instance *it = strcmp(token, "$token") ? NULL : malloc(sizeof *it);
    if (it) reset(it);
    return it;
}

static int get(instance *it, const unsigned *reference, size_t count, double *value) {
    ${name}_read(&it->plant, it->reading);
    for (size_t i = 0; i < count; i++) {
        if (reference[i] >= sizeof *it / sizeof(double)) return ERROR;
        value[i] = ((double *)it)[reference[i]];
    }
    return OK;
}

static int set(instance *it, const unsigned *reference, size_t count, const double *value) {
    for (size_t i = 0; i < count; i++) {
        if (reference[i] >= sizeof *it / sizeof(double)) return ERROR;
        ((double *)it)[reference[i]] = value[i];
    }
    return OK;
}

static int advance(instance *it, double time, double duration) {
    double last[${name}_commands];
    for (int i = 0; i < ${name}_commands; i++) last[i] = it->command[i] + it->slope[i] * duration;
    ${name}_step(&it->plant, it->command, last, duration);
    memset(it->slope, 0, sizeof it->slope);
    ${name}_read(&it->plant, it->reading);
    it->time = time + duration;
    for (int i = 0; i < ${name}_readings; i++)
        if (!isfinite(it->reading[i])) return ERROR;
    return OK;
}

/* What this model has no use for, in both versions. */
#define ABSENT(name) int name(void) { return ERROR; }
#define PASSED(name) int name(void) { return OK; }

#if FMI == 3

const char *fmi3GetVersion(void) { return "3.0"; }

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                  bool visible, bool logging, bool events, bool early,
                                  const unsigned *intermediate, size_t count, void *environment,
                                  void (*log)(void), void (*update)(void)) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)intermediate, (void)count, (void)environment, (void)log, (void)update;
    return instantiate(token);
}

void *fmi3InstantiateModelExchange(void) { return NULL; }
void *fmi3InstantiateScheduledExecution(void) { return NULL; }
void fmi3FreeInstance(void *it) { free(it); }
int fmi3Reset(void *it) { return reset(it); }

int fmi3EnterInitializationMode(void *it, bool tolerance_defined, double tolerance, double time,
                                bool stop_defined, double stop) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((instance *)it)->time = time;
    return OK;
}

int fmi3GetFloat64(void *it, const unsigned *reference, size_t count, double *value, size_t n) {
    (void)n;
    return get(it, reference, count, value);
}

int fmi3SetFloat64(void *it, const unsigned *reference, size_t count, const double *value, size_t n) {
    (void)n;
    return set(it, reference, count, value);
}

int fmi3DoStep(void *it, double time, double duration, bool final, bool *event, bool *terminate,
               bool *early, double *reached) {
    (void)final;
    *event = *terminate = *early = false;
    int status = advance(it, time, duration);
    *reached = ((instance *)it)->time;
    return status;
}

PASSED(fmi3SetDebugLogging) PASSED(fmi3ExitInitializationMode) PASSED(fmi3Terminate)
ABSENT(fmi3EnterEventMode) ABSENT(fmi3EnterStepMode) ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3ExitConfigurationMode) ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3GetFloat32) ABSENT(fmi3GetInt8) ABSENT(fmi3GetUInt8) ABSENT(fmi3GetInt16)
ABSENT(fmi3GetUInt16) ABSENT(fmi3GetInt32) ABSENT(fmi3GetUInt32) ABSENT(fmi3GetInt64)
ABSENT(fmi3GetUInt64) ABSENT(fmi3GetBoolean) ABSENT(fmi3GetString) ABSENT(fmi3GetBinary)
ABSENT(fmi3GetClock) ABSENT(fmi3SetFloat32) ABSENT(fmi3SetInt8) ABSENT(fmi3SetUInt8)
ABSENT(fmi3SetInt16) ABSENT(fmi3SetUInt16) ABSENT(fmi3SetInt32) ABSENT(fmi3SetUInt32)
ABSENT(fmi3SetInt64) ABSENT(fmi3SetUInt64) ABSENT(fmi3SetBoolean) ABSENT(fmi3SetString)
ABSENT(fmi3SetBinary) ABSENT(fmi3SetClock) ABSENT(fmi3GetNumberOfVariableDependencies)
ABSENT(fmi3GetVariableDependencies) ABSENT(fmi3GetFMUState) ABSENT(fmi3SetFMUState)
ABSENT(fmi3FreeFMUState) ABSENT(fmi3SerializedFMUStateSize) ABSENT(fmi3SerializeFMUState)
ABSENT(fmi3DeserializeFMUState) ABSENT(fmi3GetDirectionalDerivative)
ABSENT(fmi3GetAdjointDerivative) ABSENT(fmi3GetIntervalDecimal) ABSENT(fmi3GetIntervalFraction)
ABSENT(fmi3GetShiftDecimal) ABSENT(fmi3GetShiftFraction) ABSENT(fmi3SetIntervalDecimal)
ABSENT(fmi3SetIntervalFraction) ABSENT(fmi3SetShiftDecimal) ABSENT(fmi3SetShiftFraction)
ABSENT(fmi3EvaluateDiscreteStates) ABSENT(fmi3UpdateDiscreteStates)
ABSENT(fmi3CompletedIntegratorStep) ABSENT(fmi3SetTime) ABSENT(fmi3SetContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives) ABSENT(fmi3GetEventIndicators)
ABSENT(fmi3GetContinuousStates) ABSENT(fmi3GetNominalsOfContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators) ABSENT(fmi3GetNumberOfContinuousStates)
ABSENT(fmi3GetOutputDerivatives) ABSENT(fmi3ActivateModelPartition)

#else

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }

void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                      const void *callbacks, int visible, int logging) {
    (void)name, (void)resources, (void)callbacks, (void)visible, (void)logging;
    return type == 1 ? instantiate(token) : NULL;
}

void fmi2FreeInstance(void *it) { free(it); }
int fmi2Reset(void *it) { return reset(it); }

int fmi2SetupExperiment(void *it, int tolerance_defined, double tolerance, double time,
                        int stop_defined, double stop) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((instance *)it)->time = time;
    return OK;
}

int fmi2GetReal(void *it, const unsigned *reference, size_t count, double *value) {
    return get(it, reference, count, value);
}

int fmi2SetReal(void *it, const unsigned *reference, size_t count, const double *value) {
    return set(it, reference, count, value);
}

int fmi2SetRealInputDerivatives(void *it, const unsigned *reference, size_t count,
                                const int *order, const double *value) {
    instance *own = it;
    for (size_t i = 0; i < count; i++) {
        double *command = (double *)own + reference[i];
        if (order[i] != 1 || command < own->command || command >= own->reading) return ERROR;
        own->slope[command - own->command] = value[i];
    }
    return OK;
}

int fmi2DoStep(void *it, double time, double duration, int final) {
    (void)final;
    return advance(it, time, duration);
}

PASSED(fmi2SetDebugLogging) PASSED(fmi2EnterInitializationMode) PASSED(fmi2ExitInitializationMode)
PASSED(fmi2Terminate) ABSENT(fmi2GetInteger) ABSENT(fmi2GetBoolean) ABSENT(fmi2GetString)
ABSENT(fmi2SetInteger) ABSENT(fmi2SetBoolean) ABSENT(fmi2SetString) ABSENT(fmi2GetFMUstate)
ABSENT(fmi2SetFMUstate) ABSENT(fmi2FreeFMUstate) ABSENT(fmi2SerializedFMUstateSize)
ABSENT(fmi2SerializeFMUstate) ABSENT(fmi2DeSerializeFMUstate) ABSENT(fmi2GetDirectionalDerivative)
ABSENT(fmi2GetRealOutputDerivatives) ABSENT(fmi2CancelStep)
ABSENT(fmi2GetStatus) ABSENT(fmi2GetRealStatus) ABSENT(fmi2GetIntegerStatus)
ABSENT(fmi2GetBooleanStatus) ABSENT(fmi2GetStringStatus)

#endif

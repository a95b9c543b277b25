/* A driver as a functional mock-up unit, FMI @FMI@.0 for co-simulation: types are the standard's, written out.
 *
 * Functions have the prefix DRIVER_ for units that are linked statically, and none where
 * FMI@FMI@_OVERRIDE_FUNCTION_PREFIX is defined, for shared libraries. Memory is allocated where a unit is instantiated
 * or its state is asked for, and nowhere else. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "DRIVER.h"

#ifdef FMI@FMI@_OVERRIDE_FUNCTION_PREFIX
#define NAME(name) fmi@FMI@##name
#else
#define NAME(name) DRIVER_fmi@FMI@##name
#endif
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { OK, WARNING, DISCARD, ERROR } status_t;
typedef enum { NUMBER, WHOLE, TRUTH } kind_t;
typedef const uint32_t *references_t;
typedef const char *text_t;

/* Variables by their value reference. */
enum { INPUTS = sizeof(DRIVER_inputs) / sizeof(double), FOLLOWING = INPUTS - 1, OUTPUTS = INPUTS, SEED = INPUTS + 3, FAULT, TIME, VARIABLES };

/* Distances that are not there from @ABSENT@ m on: 1 by infinity, 2 by NAN. */
static const int is_distance[INPUTS] = {@DISTANCES@};

/* All that changes. */
typedef struct {
    DRIVER_state driver;
    double values[VARIABLES], stepped;
} memory_t;

enum { REST = sizeof(memory_t) - DRIVER_MEMORY, SERIALIZED = REST + DRIVER_SAVED };

#if @FMI@ == 2
typedef int truth_t;
typedef void (*log_t)(void *, const char *, int, const char *, const char *, ...);
#else
typedef bool truth_t;
typedef void (*log_t)(void *, int, const char *, const char *);
#endif

typedef struct {
    memory_t memory;
    log_t log;
    void *environment;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    char name[64];
} unit_t;

static void say(const unit_t *unit, status_t status, const char *category, const char *message) {
    if (unit->log != NULL) {
#if @FMI@ == 2
        unit->log(unit->environment, unit->name, (int)status, category, "%s", message);
#else
        unit->log(unit->environment, (int)status, category, message);
#endif
    }
}

static status_t failed(const void *instance, const char *message) {
    say((const unit_t *)instance, ERROR, "logStatusError", message);
    return ERROR;
}

static void set_up(unit_t *unit) {
    DRIVER_inputs usual;
    int k;
    memset(&unit->memory, 0, sizeof unit->memory);
    DRIVER_defaults(&usual);
    memcpy(unit->memory.values, &usual, sizeof usual);
    for (k = 0; k < INPUTS; k++) {
        unit->memory.values[k] = is_distance[k] != 0 ? @ABSENT@ : unit->memory.values[k];
    }
}

static void *new_unit(const char *name, const char *token, log_t log, void *environment,
                      void *(*allocate)(size_t, size_t), void (*release)(void *)) {
    unit_t *const unit = token != NULL && strcmp(token, "@TOKEN@") == 0 ? (unit_t *)allocate(1, sizeof *unit) : NULL;
    if (unit != NULL) {
        unit->log = log;
        unit->environment = environment;
        unit->allocate = allocate;
        unit->release = release;
        memset(unit->name, 0, sizeof unit->name);
        strncpy(unit->name, name == NULL ? "" : name, sizeof unit->name - 1);
        set_up(unit);
    }
    return unit;
}

static status_t go_to(unit_t *unit, double time) {
    memory_t *const memory = &unit->memory;
    DRIVER_inputs inputs;
    DRIVER_outputs outputs;
    double seen[INPUTS];
    int k;
    for (k = 0; k < INPUTS; k++) {
        const double absent = is_distance[k] == 1 ? (double)INFINITY : (double)NAN;
        seen[k] = is_distance[k] != 0 && memory->values[k] >= @ABSENT@ ? absent : memory->values[k];
    }
    memcpy(&inputs, seen, sizeof inputs);
    if (DRIVER_step(&memory->driver, time, &inputs, &outputs) != DRIVER_OK) {
        return failed(unit, DRIVER_message(&memory->driver));
    }
    memcpy(memory->values + OUTPUTS, &outputs, sizeof outputs);
    if (fabs((double)DRIVER_fault(&memory->driver) - memory->values[FAULT]) > 0.0) { /* said once, and the unit goes on */
        memory->values[FAULT] = (double)DRIVER_fault(&memory->driver);
        say(unit, WARNING, "logStatusWarning", DRIVER_fault_message(&memory->driver));
    }
    memory->values[TIME] = time;
    return OK;
}

static status_t begin(unit_t *unit) {
    memory_t *const memory = &unit->memory;
    const uint64_t seed = (uint64_t)memory->values[SEED];
    if (DRIVER_start(&memory->driver, seed, 0U, memory->values[TIME], DRIVER_ALL_KNOWN) != DRIVER_OK) {
        return failed(unit, DRIVER_message(&memory->driver));
    }
    return go_to(unit, memory->values[TIME]);
}

static status_t step_on(unit_t *unit, double time, double length) {
    memory_t *const memory = &unit->memory;
    status_t status = OK;
    if (memory->driver.profile == 0U) {
        return failed(unit, "a step before the end of initialization mode");
    }
    if (!(memory->stepped > 0.0) && fabs(time - memory->values[TIME]) > 0.0) { /* not every tool says before when it all begins */
        memory->values[TIME] = time;
        status = begin(unit);
    }
    memory->stepped = 1.0;
    return status == OK ? go_to(unit, time + length) : status;
}

/* Get or set variables of a kind. */
static status_t transfer(void *instance, references_t references, size_t count, kind_t kind, void *values, int sets) {
    unit_t *const unit = (unit_t *)instance;
    double *const own = unit->memory.values;
    size_t k;
    for (k = 0; k < count; k++) {
        const uint32_t r = references[k];
        const kind_t its = r == SEED || r == FAULT ? WHOLE : r == FOLLOWING ? TRUTH : NUMBER;
        if (r >= VARIABLES || its != kind || (sets != 0 && r >= OUTPUTS && r != SEED)) {
            return failed(unit, "a value reference of no variable of that type, or one that can't be set");
        }
        if (sets != 0 && r == SEED && (((int32_t *)values)[k] < 0 || unit->memory.driver.profile != 0U)) {
            return failed(unit, "seed: below 0, or set after the initialization mode");
        }
        if (kind == NUMBER && sets != 0) {
            own[r] = ((double *)values)[k];
        } else if (kind == NUMBER) {
            ((double *)values)[k] = own[r];
        } else if (kind == WHOLE && sets != 0) {
            own[r] = ((int32_t *)values)[k];
        } else if (kind == WHOLE) {
            ((int32_t *)values)[k] = (int32_t)own[r];
        } else if (sets != 0) {
            own[r] = ((truth_t *)values)[k] ? 1.0 : 0.0;
        } else {
            ((truth_t *)values)[k] = own[r] > 0.0;
        }
    }
    return OK;
}

EXPORT const char *NAME(GetVersion)(void) {
    return "@FMI@.0";
}

EXPORT void NAME(FreeInstance)(void *unit) {
    if (unit != NULL) {
        ((unit_t *)unit)->release(unit);
    }
}

EXPORT status_t NAME(ExitInitializationMode)(void *unit) {
    return begin((unit_t *)unit);
}

EXPORT status_t NAME(Reset)(void *unit) {
    set_up((unit_t *)unit);
    return OK;
}

EXPORT status_t NAME(Terminate)(void *unit) {
    (void)unit;
    return OK;
}

EXPORT status_t NAME(Get@STATE@)(void *unit, void **state) {
    *state = *state == NULL ? ((unit_t *)unit)->allocate(1, sizeof(memory_t)) : *state;
    if (*state == NULL) {
        return failed(unit, "no memory for a state");
    }
    memcpy(*state, &((unit_t *)unit)->memory, sizeof(memory_t));
    return OK;
}

EXPORT status_t NAME(Set@STATE@)(void *unit, void *state) {
    memcpy(&((unit_t *)unit)->memory, state, sizeof(memory_t));
    return OK;
}

EXPORT status_t NAME(Free@STATE@)(void *unit, void **state) {
    ((unit_t *)unit)->release(*state);
    *state = NULL;
    return OK;
}

EXPORT status_t NAME(Serialized@STATE@Size)(void *unit, void *state, size_t *size) {
    (void)unit; (void)state;
    *size = SERIALIZED;
    return OK;
}

EXPORT status_t NAME(Serialize@STATE@)(void *unit, void *state, unsigned char *bytes, size_t size) {
    if (size < SERIALIZED) {
        return failed(unit, "too few bytes for a serialized state");
    }
    memcpy(bytes, ((memory_t *)state)->values, REST);
    DRIVER_save(&((memory_t *)state)->driver, bytes + REST);
    return OK;
}

EXPORT status_t NAME(@DESERIALIZE@)(void *unit, const unsigned char *bytes, size_t size, void **state) {
    memory_t memory;
    if (size != SERIALIZED || DRIVER_restore(&memory.driver, bytes + REST, DRIVER_SAVED) != DRIVER_OK) {
        return failed(unit, "a serialized state that is damaged, or of another unit");
    }
    memcpy(memory.values, bytes, REST);
    *state = ((unit_t *)unit)->allocate(1, sizeof memory);
    if (*state == NULL) {
        return failed(unit, "no memory for a state");
    }
    memcpy(*state, &memory, sizeof memory);
    return OK;
}

/* Getter and setter of a type; of one that no variable has. */
#define GET_SET(type, name, get, set) \
    EXPORT status_t NAME(Get##name)(void *u, references_t r, size_t n, type *v MORE) { USED return get; } \
    EXPORT status_t NAME(Set##name)(void *u, references_t r, size_t n, const type *v MORE) { USED return set; }
#define VARIABLES_OF(type, name, kind) \
    GET_SET(type, name, transfer(u, r, n, kind, v, 0), transfer(u, r, n, kind, (void *)(uintptr_t)v, 1))
#define NO_VARIABLES(type, name) \
    GET_SET(type, name, ((void)r, (void)v, n == 0 ? OK : failed(u, "no variable is a " #name)), ((void)r, (void)v, n == 0 ? OK : failed(u, "no variable is a " #name)))
/* Called only where the capabilities that the description denies are asked for: further arguments stay unread. */
#define UNSUPPORTED(name) EXPORT status_t NAME(name)(void *u) { return failed(u, #name ": not supported"); }

#if @FMI@ == 2

typedef struct {
    log_t log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks_t;

#define MORE
#define USED

EXPORT const char *NAME(GetTypesPlatform)(void) {
    return "default";
}

EXPORT void *NAME(Instantiate)(const char *name, int kind, const char *token, const char *resources,
                               const callbacks_t *calls, int visible, int logs) {
    (void)resources; (void)visible;
    (void)logs; /* errors are always said */
    return kind == 1 && calls != NULL ? new_unit(name, token, calls->log, calls->environment, calls->allocate, calls->release) : NULL;
}

EXPORT status_t NAME(SetDebugLogging)(void *unit, int on, size_t count, const char *const *categories) {
    (void)unit; (void)on; (void)count; (void)categories;
    return OK;
}

EXPORT status_t NAME(SetupExperiment)(void *unit, int tolerant, double tolerance, double start, int ends, double end) {
    (void)tolerant; (void)tolerance; (void)ends; (void)end;
    ((unit_t *)unit)->memory.values[TIME] = start;
    return OK;
}

EXPORT status_t NAME(EnterInitializationMode)(void *unit) {
    (void)unit;
    return OK;
}

EXPORT status_t NAME(DoStep)(void *unit, double time, double length, int no_return) {
    (void)no_return;
    return step_on((unit_t *)unit, time, length);
}

VARIABLES_OF(double, Real, NUMBER)
VARIABLES_OF(int32_t, Integer, WHOLE)
VARIABLES_OF(truth_t, Boolean, TRUTH)
NO_VARIABLES(text_t, String)
UNSUPPORTED(CancelStep) UNSUPPORTED(GetStatus) UNSUPPORTED(GetRealStatus) UNSUPPORTED(GetIntegerStatus)
UNSUPPORTED(GetBooleanStatus) UNSUPPORTED(GetStringStatus) UNSUPPORTED(SetRealInputDerivatives)
UNSUPPORTED(GetRealOutputDerivatives) UNSUPPORTED(GetDirectionalDerivative)

#else

#define MORE , size_t m
#define USED (void)m;

EXPORT void *NAME(InstantiateCoSimulation)(const char *name, const char *token, const char *resources, bool visible,
                                           bool logs, bool events, bool early, references_t required, size_t count,
                                           void *environment, log_t log, void (*update)(void)) {
    (void)resources; (void)visible;
    (void)logs; /* errors are always said */
    (void)events; (void)early; (void)required; (void)count; (void)update;
    return new_unit(name, token, log, environment, calloc, free);
}

EXPORT status_t NAME(SetDebugLogging)(void *unit, bool on, size_t count, const char *const *categories) {
    (void)unit; (void)on; (void)count; (void)categories;
    return OK;
}

EXPORT status_t NAME(EnterInitializationMode)(void *unit, bool tolerant, double tolerance, double start, bool ends,
                                              double end) {
    (void)tolerant; (void)tolerance; (void)ends; (void)end;
    ((unit_t *)unit)->memory.values[TIME] = start;
    return OK;
}

EXPORT status_t NAME(DoStep)(void *unit, double time, double length, bool no_return, bool *event, bool *end, bool *early,
                             double *reached) {
    const status_t status = step_on((unit_t *)unit, time, length);
    (void)no_return;
    *event = *end = *early = false;
    *reached = status == OK ? time + length : time;
    return status;
}

VARIABLES_OF(double, Float64, NUMBER)
VARIABLES_OF(int32_t, Int32, WHOLE)
VARIABLES_OF(bool, Boolean, TRUTH)
NO_VARIABLES(float, Float32)
NO_VARIABLES(int8_t, Int8)
NO_VARIABLES(uint8_t, UInt8)
NO_VARIABLES(int16_t, Int16)
NO_VARIABLES(uint16_t, UInt16)
NO_VARIABLES(uint32_t, UInt32)
NO_VARIABLES(int64_t, Int64)
NO_VARIABLES(uint64_t, UInt64)
NO_VARIABLES(text_t, String)
UNSUPPORTED(GetBinary) UNSUPPORTED(SetBinary) UNSUPPORTED(GetClock) UNSUPPORTED(SetClock)
UNSUPPORTED(GetNumberOfVariableDependencies) UNSUPPORTED(GetVariableDependencies)
UNSUPPORTED(GetDirectionalDerivative) UNSUPPORTED(GetAdjointDerivative) UNSUPPORTED(GetOutputDerivatives)
UNSUPPORTED(EnterConfigurationMode) UNSUPPORTED(ExitConfigurationMode) UNSUPPORTED(EnterEventMode)
UNSUPPORTED(EnterStepMode) UNSUPPORTED(EvaluateDiscreteStates) UNSUPPORTED(UpdateDiscreteStates)
UNSUPPORTED(GetIntervalDecimal) UNSUPPORTED(GetIntervalFraction) UNSUPPORTED(GetShiftDecimal)
UNSUPPORTED(GetShiftFraction) UNSUPPORTED(SetIntervalDecimal) UNSUPPORTED(SetIntervalFraction)
UNSUPPORTED(SetShiftDecimal) UNSUPPORTED(SetShiftFraction) UNSUPPORTED(ActivateModelPartition)
UNSUPPORTED(EnterContinuousTimeMode) UNSUPPORTED(CompletedIntegratorStep) UNSUPPORTED(SetTime)
UNSUPPORTED(SetContinuousStates) UNSUPPORTED(GetContinuousStateDerivatives) UNSUPPORTED(GetEventIndicators)
UNSUPPORTED(GetContinuousStates) UNSUPPORTED(GetNominalsOfContinuousStates) UNSUPPORTED(GetNumberOfEventIndicators)
UNSUPPORTED(GetNumberOfContinuousStates)

EXPORT void *NAME(InstantiateModelExchange)(void) {
    return NULL;
}

EXPORT void *NAME(InstantiateScheduledExecution)(void) {
    return NULL;
}

#endif

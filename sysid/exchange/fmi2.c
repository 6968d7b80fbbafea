/* FMI 2.0 co-simulation of $name: value references count inputs, outputs, u0, y0 and states, in this sequence. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "$name.h"

#define GUID "$guid"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* Linked statically, the functions carry the prefix that the importing program defines. */
#ifdef FMI2_FUNCTION_PREFIX
#define JOIN(prefix, name) prefix##name
#define PREFIXED(prefix, name) JOIN(prefix, name)
#define FMI2(name) PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef unsigned int Reference;
typedef const char *Text;
typedef struct {
  void (*logger)(void *environment, Text instance, fmi2Status status, Text category, Text message, ...);
  void *(*allocate)(size_t count, size_t size);
  void (*release)(void *memory);
  void (*step_finished)(void *environment, fmi2Status status);
  void *environment;
} Callbacks;

enum {
  U = 0,
  Y = U + ${NAME}_INPUTS,
  U0 = Y + ${NAME}_OUTPUTS,
  Y0 = U0 + ${NAME}_INPUTS,
  X = Y0 + ${NAME}_OUTPUTS,
  END = X + ${NAME}_STATES
};

typedef struct {
  ${name}_model model;
  double u[$room_u];
  double y[$room_y];
  double time; /* of the last communication point */
  Callbacks callbacks;
  char name[256];
} Instance;

static fmi2Status fails(Instance *instance, Text message) {
  if (instance->callbacks.logger)
    instance->callbacks.logger(instance->callbacks.environment, instance->name, fmi2Error, "logStatusError", message);
  return fmi2Error;
}

static double *variable(Instance *instance, Reference at) {
  if (at < Y) return instance->u + at;
  if (at < U0) return instance->y + (at - Y);
  if (at < Y0) return instance->model.u0 + (at - U0);
  if (at < X) return instance->model.y0 + (at - Y0);
  return at < END ? instance->model.x + (at - X) : NULL;
}

EXPORT Text FMI2(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT Text FMI2(fmi2GetVersion)(void) { return "2.0"; }

EXPORT fmi2Status FMI2(fmi2Reset)(void *component) {
  Instance *instance = component;
  ${name}_start(&instance->model);
  memcpy(instance->u, instance->model.u0, sizeof instance->u);
  return fmi2OK;
}

EXPORT void *FMI2(fmi2Instantiate)(Text name, int kind, Text guid, Text resources, const Callbacks *callbacks,
                                   int visible, int logging) {
  Instance *instance = kind == 1 && guid && !strcmp(guid, GUID) ? calloc(1, sizeof *instance) : NULL;
  if (!instance) return NULL;
  if (callbacks) instance->callbacks = *callbacks;
  if (name) strncpy(instance->name, name, sizeof instance->name - 1);
  FMI2(fmi2Reset)(instance);
  return instance;
}

EXPORT void FMI2(fmi2FreeInstance)(void *component) { free(component); }

EXPORT fmi2Status FMI2(fmi2GetReal)(void *component, const Reference at[], size_t count, double value[]) {
  Instance *instance = component;
  ${name}_output(&instance->model, instance->u, instance->y);
  for (size_t i = 0; i < count; i++) {
    const double *from = variable(instance, at[i]);
    if (!from) return fails(instance, "fmi2GetReal: no such variable");
    value[i] = *from;
  }
  return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2SetReal)(void *component, const Reference at[], size_t count, const double value[]) {
  Instance *instance = component;
  for (size_t i = 0; i < count; i++) {
    double *to = at[i] >= Y && at[i] < U0 ? NULL : variable(instance, at[i]);
    if (!to) return fails(instance, "fmi2SetReal: no such variable, or an output");
    *to = value[i];
  }
  return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2DoStep)(void *component, double time, double size, int final) {
  Instance *instance = component;
  const double steps = floor(size / ${NAME}_DT + 0.5);
  if (!(steps >= 1.0 && fabs(size / ${NAME}_DT - steps) <= 1e-6 * steps))
    return fails(instance, "fmi2DoStep: expected a communication step of a multiple of $dt s");
  for (double k = 0.0; k < steps; k++) ${name}_step(&instance->model, instance->u);
  instance->time = time + size;
  return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2SetupExperiment)(void *component, int tolerant, double tolerance, double start, int ends,
                                            double stop) {
  ((Instance *)component)->time = start;
  return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2GetRealStatus)(void *component, int kind, double *value) {
  Instance *instance = component;
  if (kind != 2) return fails(instance, "fmi2GetRealStatus: expected fmi2LastSuccessfulTime");
  *value = instance->time;
  return fmi2OK;
}

/* The remaining functions must exist; there are no variables of other types, no saved states, no derivatives. */
#define ACCEPTED(name, ...) \
  EXPORT fmi2Status FMI2(name)(__VA_ARGS__) { return fmi2OK; }
ACCEPTED(fmi2SetDebugLogging, void *component, int on, size_t count, const Text categories[])
ACCEPTED(fmi2EnterInitializationMode, void *component)
ACCEPTED(fmi2ExitInitializationMode, void *component)
ACCEPTED(fmi2Terminate, void *component)

#define REFUSED(name, ...) \
  EXPORT fmi2Status FMI2(name)(void *component, __VA_ARGS__) { return fails(component, #name ": not available"); }
REFUSED(fmi2GetInteger, const Reference at[], size_t count, int value[])
REFUSED(fmi2GetBoolean, const Reference at[], size_t count, int value[])
REFUSED(fmi2GetString, const Reference at[], size_t count, Text value[])
REFUSED(fmi2SetInteger, const Reference at[], size_t count, const int value[])
REFUSED(fmi2SetBoolean, const Reference at[], size_t count, const int value[])
REFUSED(fmi2SetString, const Reference at[], size_t count, const Text value[])
REFUSED(fmi2GetFMUstate, void **state)
REFUSED(fmi2SetFMUstate, void *state)
REFUSED(fmi2FreeFMUstate, void **state)
REFUSED(fmi2SerializedFMUstateSize, void *state, size_t *size)
REFUSED(fmi2SerializeFMUstate, void *state, char bytes[], size_t size)
REFUSED(fmi2DeSerializeFMUstate, const char bytes[], size_t size, void **state)
REFUSED(fmi2GetDirectionalDerivative, const Reference unknown[], size_t unknowns, const Reference known[],
        size_t knowns, const double step[], double change[])
REFUSED(fmi2SetRealInputDerivatives, const Reference at[], size_t count, const int order[], const double value[])
REFUSED(fmi2GetRealOutputDerivatives, const Reference at[], size_t count, const int order[], double value[])
REFUSED(fmi2GetStatus, int kind, fmi2Status *value)
REFUSED(fmi2GetIntegerStatus, int kind, int *value)
REFUSED(fmi2GetBooleanStatus, int kind, int *value)
REFUSED(fmi2GetStringStatus, int kind, Text *value)

EXPORT fmi2Status FMI2(fmi2CancelStep)(void *component) { return fails(component, "fmi2CancelStep: not available"); }

/* FMI 2.0 for x' = f_j(x, u, p): model exchange, and co-simulation by Dormand and Prince's method of order 5(4).

   Beside this file stands model.h: N, M, P, GUID, rates(x, u, p, f) and the values at the start.
   Value references: 0 .. N-1 states, N .. 2N-1 derivatives, then M inputs, then P parameters. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

typedef unsigned int Reference;
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks;
typedef struct {
    int newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
    int valuesOfContinuousStatesChanged, nextEventTimeDefined;
    double nextEventTime;
} EventInfo;
typedef struct {
    double v[N + M + P]; /* states, inputs, parameters */
    double time, tolerance, step;
} Model;

enum { OK = 0, DISCARD = 2, FAILED = 3 };

static void derivatives(const Model *c, const double x[N], double f[N])
{
    rates(x, c->v + N, c->v + N + M, f);
}

static void set_start(Model *c)
{
    int i;
    for (i = 0; i < N + M + P; i++) c->v[i] = START[i];
    c->time = 0.0;
    c->tolerance = 1e-9;
    c->step = 1e-4;
}

/* One step of Dormand and Prince from x over h: y, and the largest error relative to the tolerance. */
static double attempt(const Model *c, const double x[N], double h, double y[N])
{
    static const double a[7][6] = {
        {0, 0, 0, 0, 0, 0},
        {1.0 / 5, 0, 0, 0, 0, 0},
        {3.0 / 40, 9.0 / 40, 0, 0, 0, 0},
        {44.0 / 45, -56.0 / 15, 32.0 / 9, 0, 0, 0},
        {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729, 0, 0},
        {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656, 0},
        {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
    static const double e[7] = {71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
    double k[7][N], z[N], worst = 0.0;
    int i, j, s;
    for (s = 0; s < 7; s++) {
        for (i = 0; i < N; i++) {
            z[i] = x[i];
            for (j = 0; j < s; j++) z[i] += h * a[s][j] * k[j][i];
        }
        derivatives(c, z, k[s]);
    }
    for (i = 0; i < N; i++) {
        double error = 0.0, size = fabs(x[i]) > fabs(z[i]) ? fabs(x[i]) : fabs(z[i]);
        for (s = 0; s < 7; s++) error += h * e[s] * k[s][i];
        error = fabs(error) / (c->tolerance * (size + 1e-3 * SIZE[i]));
        if (!(error <= worst)) worst = error; /* NaN counts as large */
        y[i] = z[i];
    }
    return worst;
}

static int carry(Model *c, double until)
{
    double y[N];
    long tries = 0;
    while (c->time < until) {
        double left = until - c->time, h = c->step < left ? c->step : left, error;
        if (left < 1e-14 * (1.0 + fabs(until))) break;
        error = attempt(c, c->v, h, y);
        if (error <= 1.0) {
            double grown = error > 1e-10 ? 0.9 * pow(error, -0.2) : 5.0;
            memcpy(c->v, y, sizeof y);
            c->time = h < left ? c->time + h : until;
            if (h >= c->step || grown < 1.0) c->step = h * (grown > 5.0 ? 5.0 : grown < 0.2 ? 0.2 : grown);
        } else {
            c->step = h * (error < 1e10 ? (0.9 * pow(error, -0.2) < 0.2 ? 0.2 : 0.9 * pow(error, -0.2)) : 0.1);
        }
        if (c->step < 1e-15 || ++tries > 10000000L) return FAILED;
    }
    c->time = until;
    return OK;
}

EXPORT const char *fmi2GetTypesPlatform(void);
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void);
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]);
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[])
{
    (void)c; (void)on; (void)n; (void)categories;
    return OK;
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *f, int visible, int logging);
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *f, int visible, int logging)
{
    Model *c;
    (void)name; (void)type; (void)resources; (void)f; (void)visible; (void)logging;
    if (!guid || strcmp(guid, GUID) != 0) return NULL;
    c = (Model *)malloc(sizeof *c);
    if (c) set_start(c);
    return c;
}

EXPORT void fmi2FreeInstance(void *c);
EXPORT void fmi2FreeInstance(void *c) { free(c); }

EXPORT int fmi2SetupExperiment(void *m, int given, double tolerance, double start, int stops, double stop);
EXPORT int fmi2SetupExperiment(void *m, int given, double tolerance, double start, int stops, double stop)
{
    Model *c = (Model *)m;
    (void)stops; (void)stop;
    c->time = start;
    if (given && tolerance > 0.0 && tolerance < c->tolerance) c->tolerance = tolerance;
    return OK;
}

#define NOTHING(name) EXPORT int name(void *c); EXPORT int name(void *c) { (void)c; return OK; }
NOTHING(fmi2EnterInitializationMode)
NOTHING(fmi2ExitInitializationMode)
NOTHING(fmi2Terminate)
NOTHING(fmi2EnterEventMode)
NOTHING(fmi2EnterContinuousTimeMode)
NOTHING(fmi2CancelStep)

EXPORT int fmi2Reset(void *c);
EXPORT int fmi2Reset(void *c)
{
    set_start((Model *)c);
    return OK;
}

EXPORT int fmi2GetReal(void *m, const Reference vr[], size_t n, double value[]);
EXPORT int fmi2GetReal(void *m, const Reference vr[], size_t n, double value[])
{
    Model *c = (Model *)m;
    double f[N];
    size_t i;
    derivatives(c, c->v, f);
    for (i = 0; i < n; i++) {
        if (vr[i] >= 2 * N + M + P) return FAILED;
        value[i] = vr[i] < N ? c->v[vr[i]] : vr[i] < 2 * N ? f[vr[i] - N] : c->v[vr[i] - N];
    }
    return OK;
}

EXPORT int fmi2SetReal(void *m, const Reference vr[], size_t n, const double value[]);
EXPORT int fmi2SetReal(void *m, const Reference vr[], size_t n, const double value[])
{
    Model *c = (Model *)m;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= 2 * N + M + P || (vr[i] >= N && vr[i] < 2 * N)) return FAILED;
        c->v[vr[i] < N ? vr[i] : vr[i] - N] = value[i];
    }
    return OK;
}

#define NO_VALUES(suffix, get, set) \
    EXPORT int fmi2Get##suffix(void *c, const Reference vr[], size_t n, get value[]); \
    EXPORT int fmi2Get##suffix(void *c, const Reference vr[], size_t n, get value[]) { (void)c; (void)vr; (void)value; return n ? FAILED : OK; } \
    EXPORT int fmi2Set##suffix(void *c, const Reference vr[], size_t n, set value[]); \
    EXPORT int fmi2Set##suffix(void *c, const Reference vr[], size_t n, set value[]) { (void)c; (void)vr; (void)value; return n ? FAILED : OK; }
NO_VALUES(Integer, int, const int)
NO_VALUES(Boolean, int, const int)
NO_VALUES(String, const char *, const char *const)

EXPORT int fmi2GetFMUstate(void *m, void **state);
EXPORT int fmi2GetFMUstate(void *m, void **state)
{
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return FAILED;
    memcpy(*state, m, sizeof(Model));
    return OK;
}

EXPORT int fmi2SetFMUstate(void *m, void *state);
EXPORT int fmi2SetFMUstate(void *m, void *state)
{
    memcpy(m, state, sizeof(Model));
    return OK;
}

EXPORT int fmi2FreeFMUstate(void *m, void **state);
EXPORT int fmi2FreeFMUstate(void *m, void **state)
{
    (void)m;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT int fmi2SerializedFMUstateSize(void *m, void *state, size_t *size);
EXPORT int fmi2SerializedFMUstateSize(void *m, void *state, size_t *size)
{
    (void)m; (void)state;
    *size = sizeof(Model);
    return OK;
}

EXPORT int fmi2SerializeFMUstate(void *m, void *state, char data[], size_t size);
EXPORT int fmi2SerializeFMUstate(void *m, void *state, char data[], size_t size)
{
    (void)m;
    if (size < sizeof(Model)) return FAILED;
    memcpy(data, state, sizeof(Model));
    return OK;
}

EXPORT int fmi2DeSerializeFMUstate(void *m, const char data[], size_t size, void **state);
EXPORT int fmi2DeSerializeFMUstate(void *m, const char data[], size_t size, void **state)
{
    (void)m;
    if (size < sizeof(Model)) return FAILED;
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return FAILED;
    memcpy(*state, data, sizeof(Model));
    return OK;
}

EXPORT int fmi2GetDirectionalDerivative(void *c, const Reference u[], size_t nu, const Reference k[], size_t nk, const double dk[], double du[]);
EXPORT int fmi2GetDirectionalDerivative(void *c, const Reference u[], size_t nu, const Reference k[], size_t nk, const double dk[], double du[])
{
    (void)c; (void)u; (void)nu; (void)k; (void)nk; (void)dk; (void)du;
    return FAILED;
}

EXPORT int fmi2NewDiscreteStates(void *c, EventInfo *info);
EXPORT int fmi2NewDiscreteStates(void *c, EventInfo *info)
{
    (void)c;
    memset(info, 0, sizeof *info);
    return OK;
}

EXPORT int fmi2CompletedIntegratorStep(void *c, int no_set, int *event, int *ends);
EXPORT int fmi2CompletedIntegratorStep(void *c, int no_set, int *event, int *ends)
{
    (void)c; (void)no_set;
    *event = *ends = 0;
    return OK;
}

EXPORT int fmi2SetTime(void *c, double time);
EXPORT int fmi2SetTime(void *c, double time)
{
    ((Model *)c)->time = time;
    return OK;
}

EXPORT int fmi2SetContinuousStates(void *c, const double x[], size_t n);
EXPORT int fmi2SetContinuousStates(void *c, const double x[], size_t n)
{
    if (n != N) return FAILED;
    memcpy(((Model *)c)->v, x, N * sizeof(double));
    return OK;
}

EXPORT int fmi2GetDerivatives(void *c, double f[], size_t n);
EXPORT int fmi2GetDerivatives(void *c, double f[], size_t n)
{
    if (n != N) return FAILED;
    derivatives((Model *)c, ((Model *)c)->v, f);
    return OK;
}

EXPORT int fmi2GetEventIndicators(void *c, double z[], size_t n);
EXPORT int fmi2GetEventIndicators(void *c, double z[], size_t n)
{
    (void)c; (void)z;
    return n ? FAILED : OK;
}

EXPORT int fmi2GetContinuousStates(void *c, double x[], size_t n);
EXPORT int fmi2GetContinuousStates(void *c, double x[], size_t n)
{
    if (n != N) return FAILED;
    memcpy(x, ((Model *)c)->v, N * sizeof(double));
    return OK;
}

EXPORT int fmi2GetNominalsOfContinuousStates(void *c, double x[], size_t n);
EXPORT int fmi2GetNominalsOfContinuousStates(void *c, double x[], size_t n)
{
    (void)c;
    if (n != N) return FAILED;
    memcpy(x, SIZE, sizeof SIZE);
    return OK;
}

EXPORT int fmi2SetRealInputDerivatives(void *c, const Reference vr[], size_t n, const int order[], const double value[]);
EXPORT int fmi2SetRealInputDerivatives(void *c, const Reference vr[], size_t n, const int order[], const double value[])
{
    (void)c; (void)vr; (void)order; (void)value;
    return n ? FAILED : OK;
}

EXPORT int fmi2GetRealOutputDerivatives(void *c, const Reference vr[], size_t n, const int order[], double value[]);
EXPORT int fmi2GetRealOutputDerivatives(void *c, const Reference vr[], size_t n, const int order[], double value[])
{
    (void)c; (void)vr; (void)order; (void)value;
    return n ? FAILED : OK;
}

EXPORT int fmi2DoStep(void *c, double now, double step, int no_set);
EXPORT int fmi2DoStep(void *c, double now, double step, int no_set)
{
    (void)no_set;
    ((Model *)c)->time = now;
    return carry((Model *)c, now + step);
}

#define NO_STATUS(suffix, type) \
    EXPORT int fmi2Get##suffix(void *c, int kind, type *value); \
    EXPORT int fmi2Get##suffix(void *c, int kind, type *value) { (void)c; (void)kind; (void)value; return DISCARD; }
NO_STATUS(Status, int)
NO_STATUS(RealStatus, double)
NO_STATUS(IntegerStatus, int)
NO_STATUS(BooleanStatus, int)
NO_STATUS(StringStatus, const char *)

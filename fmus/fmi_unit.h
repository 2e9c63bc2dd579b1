/* A unit for co-simulation, whichever version of FMI its host speaks (fmi2_unit.h, fmi3_unit.h).
 *
 * The file of a component includes arithmetic.h, defines Variables, DECLARED, Configured, State and
 *
 *     configure(problem, v, c)                      derives values from the parameters
 *     start(problem, v, c, s, lists, t)             sets the state at start time
 *     advance(problem, v, c, s, lists, t, h)        advances the state from t to t + h
 *     output(problem, v, c, s, lists, y, t)         computes all outputs at t
 *
 * which return 0, or 1 with the exception that the component would have raised in `problem`, and includes this
 * file last. Order of calls and messages are those of components/fmi/component.py. There are no global variables,
 * so instances may run in any number of threads. */
#if defined __GNUC__
#pragma GCC system_header /* warnings of the compiler are about the component */
#endif
#include "calling_sequence.h"
#include "seal.h"

#if defined _WIN32
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

#define ONLY_CO_SIMULATION "this FMU is for co-simulation only"

#ifndef OUTPUT_NUMBER /* of a variable among the outputs */
#define OUTPUT_NUMBER(i) ((i) - N_INPUTS)
#endif

typedef unsigned int Reference;
typedef enum { OK = 0, ERROR = 3 } Status; /* the numbers of both versions of FMI */

/* Everything that is saved and restored with the state of an instance. */
typedef struct {
    Variables v;
    Configured c;
    State s;
    double y[N_OUTPUTS > 0 ? N_OUTPUTS : 1];
    double start_time;
    int initializing; /* until initialization ends, outputs follow the inputs */
    int stale;        /* a variable has been set since the outputs were computed */
    int configured;   /* since the last change of a parameter */
    Progress at;
} Content;

typedef struct {
    Content content;
    List lists[N_LISTS > 0 ? N_LISTS : 1];
} Saved;

typedef struct Host Host;
struct Host {
    void (*send)(const Host *, const char *name, const char *category, const char *text);
    void (*logger)(void); /* of the version of FMI that `send` knows; may be NULL */
    void *environment;
    Reference first; /* value reference of the first variable in this version */
};

typedef struct {
    Host host;
    char *name;
    Saved now;
} Instance;

/* ---- log ---- */

static Status complain(const Instance *instance, const char *text)
{
    if (instance->host.logger != NULL) {
        instance->host.send(&instance->host, instance->name, "logStatusError", text);
    }
    return ERROR;
}

static Status complain_of(const Instance *instance, const char *call, const char *text)
{
    char whole[256];
    snprintf(whole, sizeof whole, "%s: %s", call, text);
    return complain(instance, whole);
}

static Status refuse(const Instance *instance, const Refusal *why)
{
    return complain(instance, why->text);
}

static double *real_at(Instance *instance, size_t i)
{
    return (double *)((char *)&instance->now.content.v + DECLARED[i].place);
}

static int *other_at(Instance *instance, size_t i)
{
    return (int *)((char *)&instance->now.content.v + DECLARED[i].place);
}

/* Log an exception as the component would, and mark the instance as failed. */
static Status fail(Instance *instance, const char *what, double t, const Problem *problem)
{
    static const Problem empty;
    Problem *sentence = malloc(sizeof *sentence);
    char number[64];
    instance->now.content.at.failed = 1;
    if (sentence == NULL) {
        return complain(instance, what);
    }
    *sentence = empty;
    say(sentence, what);
    say(sentence, " at t = ");
    say_real(sentence, t, 9);
    say(sentence, " s: ");
    say(sentence, problem->kind);
    say(sentence, ": ");
    say(sentence, problem->text);
    say(sentence, problem->where);
    const char *before = "; inputs: ";
    for (size_t i = 0; i < N_VARIABLES; i++) {
        if (DECLARED[i].causality != INPUT) {
            continue;
        }
        say(sentence, before);
        before = ", ";
        say(sentence, DECLARED[i].name);
        say(sentence, " = ");
        write_repr(number, *real_at(instance, i));
        if (sizeof sentence->text - sentence->length < sizeof number + 64) { /* truncated, unlike in Python */
            say(sentence, "...");
            break;
        }
        say(sentence, number);
    }
    complain(instance, sentence->text);
    free(sentence);
    return ERROR;
}

/* "reading Real [3, 4] failed", in memory that the caller frees. */
static char *naming(const char *doing, const char *type, const Reference r[], size_t n)
{
    char *text = malloc(64 + 12 * n), *end = text;
    if (text != NULL) {
        end += sprintf(end, "%s %s [", doing, type);
        for (size_t i = 0; i < n; i++) {
            end += sprintf(end, i == 0 ? "%u" : ", %u", r[i]);
        }
        strcpy(end, "] failed");
    }
    return text;
}

static Status fail_at(Instance *instance, const char *doing, const char *type, const Reference r[], size_t n,
                      const Problem *problem)
{
    char *text = naming(doing, type, r, n);
    Status status = fail(instance, text == NULL ? doing : text, instance->now.content.start_time, problem);
    free(text);
    return status;
}

static void say_name(const Instance *instance, Problem *problem, Reference r)
{
    char text[32];
    snprintf(text, sizeof text, "value reference %u", r);
    say(problem, r - instance->host.first < N_VARIABLES ? DECLARED[r - instance->host.first].name : text);
}

/* Fail since a variable is not what a call takes it for, or must not be set. */
static Status fail_of(Instance *instance, const char *doing, const char *type, const Reference r[], size_t n,
                      Reference wrong, const char *kind, const char *why, const char *more)
{
    Problem problem;
    begin_problem(&problem, kind, "");
    say_name(instance, &problem, wrong);
    say(&problem, why);
    say(&problem, more);
    return fail_at(instance, doing, type, r, n, &problem);
}

/* ---- functions of the component ---- */

/* Check a parameter; 1 with the problem if its value is not allowed. */
static int wrong_parameter(Instance *instance, size_t i, Problem *problem)
{
    const Declared *d = &DECLARED[i];
    if (d->type == ENUMERATION && (unsigned)*other_at(instance, i) >= (unsigned)d->n_choices) {
        begin_problem(problem, "ValueError", "");
        say(problem, d->name);
        say(problem, " must be one of ");
        for (int k = 0; k < d->n_choices; k++) {
            say(problem, k == 0 ? "" : ", ");
            say(problem, d->choices[k]);
        }
        say(problem, " (got ");
        say_integer(problem, (int)((unsigned)*other_at(instance, i) + 1u));
        say(problem, ")");
        return 1;
    }
    if (d->type == ENUMERATION) {
        return 0;
    }
    double x = d->type == REAL ? *real_at(instance, i) : *other_at(instance, i);
    int finite = d->type != REAL || (x >= -1e308 && x <= 1e308);
    if (finite && !(x < d->min) && !(x > d->max)) {
        return 0;
    }
    begin_problem(problem, "ValueError", "");
    say(problem, d->name);
    say(problem, !finite ? " must be a finite number" : x < d->min ? " must be at least " : " must be at most ");
    if (finite) {
        say_real(problem, x < d->min ? d->min : d->max, 6);
    }
    say(problem, " (got ");
    if (d->type == REAL) {
        say_real(problem, x, 0);
    } else if (d->type == INTEGER) {
        say_integer(problem, x);
    } else {
        say(problem, x != 0.0 ? "True" : "False");
    }
    say(problem, ")");
    return 1;
}

static int bring_up_to_date(Instance *instance, Problem *problem)
{
    Content *now = &instance->now.content;
    if (now->configured) {
        return 0;
    }
    for (size_t i = 0; i < N_VARIABLES; i++) {
        if (DECLARED[i].causality == PARAMETER && wrong_parameter(instance, i, problem)) {
            return 1;
        }
    }
    if (configure(problem, &now->v, &now->c)) {
        return 1;
    }
    now->configured = 1;
    return 0;
}

static int refresh(Instance *instance, Problem *problem)
{
    Content *now = &instance->now.content;
    double y[sizeof now->y / sizeof *now->y];
    if (bring_up_to_date(instance, problem) ||
        start(problem, &now->v, &now->c, &now->s, instance->now.lists, now->start_time) ||
        output(problem, &now->v, &now->c, &now->s, instance->now.lists, y, now->start_time)) {
        return 1;
    }
    memcpy(now->y, y, sizeof y);
    now->stale = 0;
    return 0;
}

static void begin(Instance *instance)
{
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        free(instance->now.lists[i].items);
    }
    memset(&instance->now, 0, sizeof instance->now);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        if (DECLARED[i].type == REAL) {
            *real_at(instance, i) = DECLARED[i].start;
        } else {
            *other_at(instance, i) = (int)DECLARED[i].start;
        }
    }
    instance->now.content.initializing = 1;
    instance->now.content.stale = 1;
}

/* ---- life cycle ---- */

static void discard(Instance *instance)
{
    if (instance == NULL) {
        return;
    }
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        free(instance->now.lists[i].items);
    }
    free(instance->name);
    free(instance);
}

/* Return a new instance; NULL after complaining, of `refusal` if it is not NULL. */
static Instance *make(Host host, const char *call, const char *name, const char *token, const char *refusal)
{
    Instance *instance = calloc(1, sizeof *instance);
    char text[64];
    if (instance == NULL) {
        return NULL;
    }
    instance->host = host;
    instance->name = malloc(name == NULL ? 1 : strlen(name) + 1);
    if (instance->name == NULL) {
        free(instance);
        return NULL;
    }
    strcpy(instance->name, name == NULL ? "" : name);
    snprintf(text, sizeof text, "%s needs an instance name in UTF-8", call);
    const char *problem = *instance->name == '\0' ? text
                          : token == NULL || strcmp(token, GUID) != 0
                              ? "the GUID is not that of this FMU: the model description is of another build"
                              : refusal;
    if (problem != NULL) {
        complain(instance, problem);
        discard(instance);
        return NULL;
    }
    begin(instance);
    return instance;
}

static Status set_times(Instance *instance, const char *call, double start, int stop_defined, double stop)
{
    Refusal why;
    if (!set_up(&instance->now.content.at, call, start, stop_defined, stop, &why)) {
        return refuse(instance, &why);
    }
    instance->now.content.start_time = start;
    instance->now.content.stale = 1;
    return OK;
}

static Status enter_initialization(Instance *instance, const char *call)
{
    Content *now = &instance->now.content;
    Refusal why;
    Problem problem;
    if (!pass_on(&now->at, BEFORE_INITIALIZATION, DURING_INITIALIZATION, call, &why)) {
        return refuse(instance, &why);
    }
    return bring_up_to_date(instance, &problem)
               ? fail(instance, "initialization failed", now->start_time, &problem)
               : OK;
}

static Status exit_initialization(Instance *instance, const char *call)
{
    Content *now = &instance->now.content;
    Refusal why;
    Problem problem;
    if (!pass_on(&now->at, DURING_INITIALIZATION, AFTER_INITIALIZATION, call, &why)) {
        return refuse(instance, &why);
    }
    if (now->stale && refresh(instance, &problem)) {
        return fail(instance, "initialization failed", now->start_time, &problem);
    }
    now->initializing = 0;
    return OK;
}

static Status step(Instance *instance, const char *call, double t, double h)
{
    Content *now = &instance->now.content;
    Refusal why;
    Problem problem;
    double y[sizeof now->y / sizeof *now->y];
    if (now->at.failed) {
        return ERROR;
    }
    if (!may_step(&now->at, call, t, h, &why)) {
        return refuse(instance, &why);
    }
    if (bring_up_to_date(instance, &problem) ||
        advance(&problem, &now->v, &now->c, &now->s, instance->now.lists, t, h) ||
        output(&problem, &now->v, &now->c, &now->s, instance->now.lists, y, t + h)) {
        return fail(instance, "step failed", t, &problem);
    }
    memcpy(now->y, y, sizeof y);
    now->at.time = t + h;
    return OK;
}

static Status end(Instance *instance, const char *call)
{
    Refusal why;
    return terminate(&instance->now.content.at, call, &why) ? OK : refuse(instance, &why);
}

/* ---- values ---- */

static Status get_reals(Instance *instance, const char *type, const Reference r[], size_t n, double values[])
{
    Content *now = &instance->now.content;
    Status status = OK;
    for (size_t i = 0; i < n && now->stale && now->initializing && !now->at.failed; i++) {
        Problem problem;
        Reference k = r[i] - instance->host.first;
        if (k < N_VARIABLES && DECLARED[k].causality == OUTPUT && refresh(instance, &problem)) {
            status = fail(instance, "initialization failed", now->start_time, &problem);
        }
    }
    for (size_t i = 0; i < n; i++) {
        Reference k = r[i] - instance->host.first;
        if (k >= N_REALS) {
            for (size_t j = 0; j < n; j++) {
                values[j] = NAN;
            }
            return fail_of(instance, "reading", type, r, n, r[i], "TypeError", " is not of type ", type);
        }
        values[i] = DECLARED[k].causality == OUTPUT ? now->y[OUTPUT_NUMBER(k)] : *real_at(instance, k);
    }
    return status;
}

static Status set_reals(Instance *instance, const char *type, const Reference r[], size_t n, const double values[])
{
    Content *now = &instance->now.content;
    for (size_t i = 0; i < n; i++) {
        Reference k = r[i] - instance->host.first;
        int is_input = k < N_REALS && DECLARED[k].causality == INPUT;
        int is_parameter = k < N_REALS && DECLARED[k].causality == PARAMETER;
        if (!is_input && !(is_parameter && (now->initializing || DECLARED[k].tunable))) {
            return fail_of(instance, "setting", type, r, n, r[i], "ValueError",
                           now->initializing ? " cannot be set" : " cannot be set after initialization", "");
        }
        *real_at(instance, k) = values[i];
        if (is_parameter) {
            now->configured = 0;
        }
    }
    if (now->initializing) {
        now->stale = 1;
    }
    return OK;
}

enum { INTEGERS = 1 << INTEGER, BOOLEANS = 1 << BOOLEAN, ENUMERATIONS = 1 << ENUMERATION, TEXTS = 0 };

/* Return the place of a reference that is not of one of these kinds, `n` if all are. */
static size_t wrong_kind(const Instance *instance, int kinds, const Reference r[], size_t n)
{
    size_t i = 0;
    while (i < n && r[i] - instance->host.first < N_VARIABLES && kinds & 1 << DECLARED[r[i] - instance->host.first].type) {
        i++;
    }
    return i;
}

/* Items of an enumeration count from 1; in Variables, from 0. */
static int first_item(Reference k)
{
    return DECLARED[k].type == ENUMERATION;
}

static Status get_others(Instance *instance, int kinds, const char *type, const Reference r[], size_t n, int values[])
{
    size_t wrong = wrong_kind(instance, kinds, r, n);
    for (size_t i = 0; i < n; i++) {
        Reference k = r[i] - instance->host.first;
        values[i] = wrong < n ? 0 : (int)((unsigned)*other_at(instance, k) + (unsigned)first_item(k));
    }
    return wrong == n ? OK
                      : fail_of(instance, "reading", type, r, n, r[wrong], "TypeError", " is not of type ", type);
}

static Status set_others(Instance *instance, int kinds, const char *type, const Reference r[], size_t n,
                         const int values[])
{
    if (n == 0) {
        return OK;
    }
    if (!instance->now.content.initializing) {
        return fail_of(instance, "setting", type, r, n, r[0], "ValueError", " cannot be set after initialization", "");
    }
    size_t wrong = wrong_kind(instance, kinds, r, n);
    if (wrong < n) {
        return fail_of(instance, "setting", type, r, n, r[wrong], "TypeError", " is not of type ", type);
    }
    instance->now.content.configured = 0;
    instance->now.content.stale = 1;
    for (size_t i = 0; i < n; i++) {
        Reference k = r[i] - instance->host.first;
        *other_at(instance, k) = kinds == BOOLEANS ? values[i] != 0 : (int)((unsigned)values[i] - (unsigned)first_item(k));
    }
    return OK;
}

/* ---- state ---- */

static void forget(Saved *saved)
{
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        free(saved->lists[i].items);
    }
}

/* Copy a state, with its lists starting at their first items; false if out of memory. */
static int copy(Saved *to, const Saved *from)
{
    Saved made = {.content = from->content};
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        for (size_t k = 0; k < from->lists[i].count; k++) {
            if (!push(&made.lists[i], WIDTHS[i], item(&from->lists[i], WIDTHS[i], (double)k))) {
                forget(&made);
                return 0;
            }
        }
    }
    forget(to);
    *to = made;
    return 1;
}

static Status save(Instance *instance, const char *call, void **state)
{
    if (state == NULL) {
        return complain_of(instance, call, "no place for the state");
    }
    Saved *saved = *state != NULL ? *state : calloc(1, sizeof *saved);
    if (saved == NULL || !copy(saved, &instance->now)) {
        if (saved != *state) {
            free(saved);
        }
        return complain_of(instance, call, "out of memory");
    }
    *state = saved;
    return OK;
}

static Status restore(Instance *instance, const char *call, void *state)
{
    if (state == NULL) {
        return complain_of(instance, call, "no state given");
    }
    return copy(&instance->now, state) ? OK : complain_of(instance, call, "out of memory");
}

static Status free_state(void **state)
{
    if (state != NULL && *state != NULL) {
        forget(*state);
        free(*state);
        *state = NULL;
    }
    return OK;
}

/* Serialized state: content, count and items of each list, seal. */
static Status size_of_state(Instance *instance, const char *call, void *state, size_t *size)
{
    if (state == NULL || size == NULL) {
        return complain_of(instance, call, "no state, or no place for its size");
    }
    *size = sizeof(Content) + sizeof(Seal);
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        size_t count = ((Saved *)state)->lists[i].count;
        *size += sizeof(uint64_t) + count * (size_t)WIDTHS[i] * sizeof(double);
    }
    return OK;
}

static Status serialize(Instance *instance, const char *call, void *state, char *bytes, size_t size)
{
    size_t needed;
    if (state == NULL || bytes == NULL) {
        return complain_of(instance, call, "no state, or no place for the bytes");
    }
    size_of_state(instance, call, state, &needed);
    if (size < needed) {
        return complain_of(instance, call, "the place for the bytes is too small");
    }
    const Saved *saved = state;
    char *end = bytes;
    memcpy(end, &saved->content, sizeof saved->content), end += sizeof saved->content;
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        uint64_t count = saved->lists[i].count;
        size_t one = (size_t)WIDTHS[i] * sizeof(double);
        memcpy(end, &count, sizeof count), end += sizeof count;
        for (size_t k = 0; k < count; k++) {
            memcpy(end, item(&saved->lists[i], WIDTHS[i], (double)k), one), end += one;
        }
    }
    seal(GUID, bytes, (size_t)(end - bytes));
    return OK;
}

static int read_state(Saved *saved, const char *bytes, size_t size)
{
    const char *end = bytes + size - sizeof(Seal);
    if (!is_sealed(GUID, bytes, size) || size < sizeof(Content) + sizeof(Seal)) {
        return 0;
    }
    memcpy(&saved->content, bytes, sizeof(Content)), bytes += sizeof(Content);
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        uint64_t count;
        size_t one = (size_t)WIDTHS[i] * sizeof(double);
        if ((size_t)(end - bytes) < sizeof count) {
            return 0;
        }
        memcpy(&count, bytes, sizeof count), bytes += sizeof count;
        if (count > (size_t)(end - bytes) / one) {
            return 0;
        }
        for (uint64_t k = 0; k < count; k++, bytes += one) {
            if (!push(&saved->lists[i], WIDTHS[i], bytes)) {
                return 0;
            }
        }
    }
    return bytes == end;
}

static Status deserialize(Instance *instance, const char *call, const char *bytes, size_t size, void **state)
{
    if (bytes == NULL || state == NULL) {
        return complain_of(instance, call, "no bytes, or no place for the state");
    }
    Saved *saved = calloc(1, sizeof *saved);
    if (saved == NULL || !read_state(saved, bytes, size)) {
        if (saved != NULL) {
            forget(saved);
        }
        free(saved);
        return complain_of(instance, call, "not a state of this FMU");
    }
    free_state(state);
    *state = saved;
    return OK;
}

/* ---- functions of FMI ---- */

/* A function that answers with a status: version, name, parameters, and what it returns for an instance. */
#define ANSWER(fmi, name, parameters, answer)                                                               \
    EXPORTED fmi##Status fmi##name parameters                                                               \
    {                                                                                                       \
        const char *const call = #fmi #name;                                                                \
        Instance *instance = c;                                                                             \
        (void)call;                                                                                         \
        return instance == NULL ? fmi##Error : (fmi##Status)(answer);                                       \
    }

/* Functions that both versions have, which spell two words in their own way. Only errors are logged, and always. */
#define FUNCTIONS_OF_BOTH(fmi, State, Deserialize)                                                          \
    ANSWER(fmi, ExitInitializationMode, (void *c), exit_initialization(instance, call))                     \
    ANSWER(fmi, Terminate, (void *c), end(instance, call))                                                  \
    ANSWER(fmi, Reset, (void *c), (begin(instance), OK))                                                    \
    ANSWER(fmi, Get##State, (void *c, void **state), save(instance, call, state))                           \
    ANSWER(fmi, Set##State, (void *c, void *state), restore(instance, call, state))                         \
    ANSWER(fmi, Free##State, (void *c, void **state), free_state(state))                                    \
    ANSWER(fmi, Serialized##State##Size, (void *c, void *state, size_t *size),                              \
           size_of_state(instance, call, state, size))                                                      \
    ANSWER(fmi, Serialize##State, (void *c, void *state, fmi##Byte bytes[], size_t size),                   \
           serialize(instance, call, state, (char *)bytes, size))                                           \
    ANSWER(fmi, Deserialize##State, (void *c, const fmi##Byte bytes[], size_t size, void **state),          \
           deserialize(instance, call, (const char *)bytes, size, state))                                   \
    ANSWER(fmi, SetDebugLogging, (void *c, fmi##Boolean on, size_t n, const fmi##String names[]),           \
           ((void)on, n == 0 || names != NULL ? OK : complain_of(instance, call, "no categories given")))

#include "fmi2_unit.h"
#include "fmi3_unit.h"

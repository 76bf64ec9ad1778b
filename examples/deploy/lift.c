/* A lift under an exported controller: a loop of 10 Hz that reads, steps and commands, in fixed memory.
 *
 *     lift MODEL.onnx EPISODE.csv [--fast]
 *
 * The readings come from the file that `aframe export` writes beside the model; in an installation they come from the
 * sensors, and read_row() is what changes. Prints a line for each step: command [rad/s], fault. --fast does not wait.
 * Exit status: 0 after a whole lift, 1 for bad input, 3 for a lift that ended in a safe stop.
 */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <onnxruntime_c_api.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { API_VERSION = 18, INPUTS = 3, OUTPUTS = 3, LINE = 4096 };
enum { READINGS, TOLD, STATE };            /* the inputs */
enum { DRUM_SPEED, FAULT, NEXT_STATE };    /* the outputs */

static const char *const INPUT_NAMES[INPUTS] = {"readings", "told", "state"};
static const char *const OUTPUT_NAMES[OUTPUTS] = {"drum_speed", "fault", "next_state"};
static const long PERIOD_NS = 100000000L;
static const OrtApi *api;

static void fail(const char *what)
{
    fprintf(stderr, "error: %s\n", what);
    exit(1);
}

/* For set-up alone: there is no drum to be stopped yet. */
static void must(OrtStatus *status)
{
    if (status != NULL)
        fail(api->GetErrorMessage(status));
}

/* Number of values of an input, whose shape is fixed. */
static size_t size_of_input(const OrtSession *session, size_t index)
{
    OrtTypeInfo *type;
    const OrtTensorTypeAndShapeInfo *shape;
    size_t size;
    must(api->SessionGetInputTypeInfo(session, index, &type));
    must(api->CastTypeInfoToTensorInfo(type, &shape));
    must(api->GetTensorShapeElementCount(shape, &size));
    api->ReleaseTypeInfo(type);
    return size;
}

/* A tensor of one dimension on memory that stays where it is. */
static OrtValue *tensor(const OrtMemoryInfo *memory, double *data, size_t size)
{
    const int64_t shape[1] = {(int64_t)size};
    OrtValue *value;
    must(api->CreateTensorWithDataAsOrtValue(
        memory, data, size * sizeof *data, shape, 1, ONNX_TENSOR_ELEMENT_DATA_TYPE_DOUBLE, &value));
    return value;
}

static double *zeros(size_t size)
{
    double *data = calloc(size, sizeof *data);
    if (data == NULL)
        fail("no memory");
    return data;
}

/* Values of the next row, NaN for what is missing or no number; 0 at the end of the file. */
static int read_row(FILE *file, double *first, size_t first_size, double *second, size_t second_size)
{
    static char line[LINE];
    char *at = line, *end;
    if (fgets(line, sizeof line, file) == NULL)
        return 0;
    for (size_t i = 0; i < first_size + second_size; i++) {
        double *value = i < first_size ? first + i : second + (i - first_size);
        *value = strtod(at, &end);
        if (end == at)
            *value = NAN;
        at = end + strcspn(end, ",\n");
        if (*at == ',')
            at++;
    }
    return 1;
}

static double seconds_since(const struct timespec *start)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)(now.tv_sec - start->tv_sec) + 1e-9 * (double)(now.tv_nsec - start->tv_nsec);
}

int main(int count, char **arguments)
{
    const int fast = count == 4 && strcmp(arguments[3], "--fast") == 0;
    if (count != 3 && !fast)
        fail("usage: lift MODEL.onnx EPISODE.csv [--fast]");
    api = OrtGetApiBase()->GetApi(API_VERSION);
    if (api == NULL)
        fail("ONNX Runtime 1.18 or later is needed");
    FILE *file = fopen(arguments[2], "r");
    static char header[LINE];
    if (file == NULL || fgets(header, sizeof header, file) == NULL)
        fail("the episode cannot be read");

    /* All memory of the loop is had here. */
    OrtEnv *env;
    OrtSessionOptions *options;
    OrtSession *session;
    OrtMemoryInfo *memory;
    must(api->CreateEnv(ORT_LOGGING_LEVEL_ERROR, "lift", &env));
    must(api->CreateSessionOptions(&options));
    must(api->SetIntraOpNumThreads(options, 1));
    must(api->SetInterOpNumThreads(options, 1));
    must(api->CreateSession(env, arguments[1], options, &session));
    must(api->CreateCpuMemoryInfo(OrtArenaAllocator, OrtMemTypeDefault, &memory));
    size_t sizes[INPUTS];
    for (size_t i = 0; i < INPUTS; i++)
        sizes[i] = size_of_input(session, i);
    double *readings = zeros(sizes[READINGS]), *told = zeros(sizes[TOLD]), speed = 0.0, fault = 0.0;
    OrtValue *const readings_value = tensor(memory, readings, sizes[READINGS]);
    OrtValue *const told_value = tensor(memory, told, sizes[TOLD]);
    OrtValue *const speed_value = tensor(memory, &speed, 1), *const fault_value = tensor(memory, &fault, 1);
    /* The state goes to and fro between two places. */
    OrtValue *states[2];
    for (int i = 0; i < 2; i++)
        states[i] = tensor(memory, zeros(sizes[STATE]), sizes[STATE]);

    double worst = 0.0, last = 0.0, most = 0.0;
    long steps = 0, late = 0;
    int stopped = 0;
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (; read_row(file, readings, sizes[READINGS], told, sizes[TOLD]); steps++) {
        struct timespec start;
        clock_gettime(CLOCK_MONOTONIC, &start);
        if (steps == 0) /* told: ..., greatest speed, greatest acceleration, lag */
            most = told[sizes[TOLD] - 2] * 1e-9 * (double)PERIOD_NS;
        const OrtValue *const inputs[INPUTS] = {readings_value, told_value, states[steps % 2]};
        OrtValue *outputs[OUTPUTS] = {speed_value, fault_value, states[(steps + 1) % 2]};
        OrtStatus *status = stopped > 1 ? NULL : api->Run(
            session, NULL, INPUT_NAMES, inputs, INPUTS, OUTPUT_NAMES, OUTPUTS, outputs);
        if (status != NULL) {
            fprintf(stderr, "step %ld: %s\n", steps, api->GetErrorMessage(status));
            api->ReleaseStatus(status);
            stopped = 2;
        }
        if (stopped > 1) { /* Without the model: as it would do it, from the last command. */
            speed = most >= fabs(last) || !isfinite(most) ? 0.0 : last - copysign(most, last);
            fault = 1.0;
        }
        if (fault != 0.0 && stopped == 0) {
            fprintf(stderr, "step %ld: bad readings, safe stop\n", steps);
            stopped = 1;
        }
        last = speed;
        const double taken = seconds_since(&start);
        worst = taken > worst ? taken : worst;
        printf("%.17g,%d\n", speed, fault != 0.0);
        if (!fast) {
            due.tv_nsec += PERIOD_NS;
            due.tv_sec += due.tv_nsec / 1000000000L;
            due.tv_nsec %= 1000000000L;
            if (seconds_since(&due) > 0.0)
                late++;
            fflush(stdout);
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        }
    }
    fprintf(stderr, "%ld steps, %ld late, the worst took %.3f ms\n", steps, late, 1e3 * worst);
    return stopped ? 3 : 0;
}

/* A small SAR simulator, as an example of a program that radcal drives.
 *
 *   sim INPUT OUTPUT     simulate the image that INPUT describes
 *   sim --version
 *
 * INPUT holds numbers line by line; what follows them on a line is a remark. OUTPUT is raw
 * float32 power, row by row, in the byte order of the machine. Each pixel is sigma0 at its
 * incidence, times speckle: the mean of `looks` exponential numbers, which depend on seed and
 * pixel alone, so that equal seeds give equal speckle whatever the parameters.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define VERSION "sim 1.0"
#define LINE 512

static void fail(const char *message)
{
    fprintf(stderr, "sim: %s\n", message);
    exit(1);
}

/* SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014 */
static uint64_t mixed(uint64_t z)
{
    z += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static double uniform(uint64_t seed, uint64_t number)
{
    return ((double)(mixed(mixed(seed) ^ number) >> 11) + 0.5) / 9007199254740992.0; /* 2^53 */
}

static void line_of(FILE *file, char *line)
{
    if (!fgets(line, LINE, file))
        fail("the input ends too early");
}

int main(int argc, char **argv)
{
    const double radian = 3.14159265358979323846 / 180.0;
    char line[LINE], name[LINE];
    int rows, columns, looks, materials, row, column, look, m;
    double near_deg, far_deg, x[256][4];
    unsigned long long seed;
    unsigned char *label;
    float *power;
    FILE *file;

    if (argc == 2 && strcmp(argv[1], "--version") == 0) {
        puts(VERSION);
        return 0;
    }
    if (argc != 3)
        fail("expected INPUT and OUTPUT");
    if (!(file = fopen(argv[1], "r")))
        fail("the input cannot be read");
    line_of(file, line);
    if (sscanf(line, "%511s %d %d", name, &rows, &columns) != 3 || rows < 2 || columns < 1)
        fail("line 1: expected the file of labels, rows and columns");
    line_of(file, line);
    if (sscanf(line, "%lf %lf", &near_deg, &far_deg) != 2)
        fail("line 2: expected near and far incidence");
    line_of(file, line);
    if (sscanf(line, "%llu %d", &seed, &looks) != 2 || looks < 1)
        fail("line 3: expected seed and looks");
    line_of(file, line);
    if (sscanf(line, "%d", &materials) != 1 || materials < 0 || materials > 255)
        fail("line 4: expected the number of materials");
    for (m = 1; m <= materials; m++) {
        line_of(file, line);
        if (sscanf(line, "%lf %lf %lf %lf", &x[m][0], &x[m][1], &x[m][2], &x[m][3]) != 4)
            fail("expected four parameters of each material");
    }
    fclose(file);

    label = malloc((size_t)rows * columns);
    power = malloc((size_t)rows * columns * sizeof *power);
    if (!label || !power)
        fail("out of memory");
    if (!(file = fopen(name, "rb")) || fread(label, 1, (size_t)rows * columns, file) != (size_t)rows * columns)
        fail("the labels cannot be read");
    fclose(file);

    for (row = 0; row < rows; row++) {
        /* flat ground: the slant range over the height is 1 / cos(incidence), in equal steps */
        double first = 1.0 / cos(near_deg * radian), last = 1.0 / cos(far_deg * radian);
        double cosine = 1.0 / (first + (last - first) * row / (rows - 1)), phi = acos(cosine);
        for (column = 0; column < columns; column++) {
            size_t pixel = (size_t)row * columns + column;
            double speckle = 0.0, sigma0 = 1e-4;
            m = label[pixel];
            if (m > materials)
                fail("a label without parameters");
            if (m > 0)
                sigma0 = pow(10.0, 0.1 * (x[m][0] + x[m][1] * cosine + x[m][2] * exp(-x[m][3] * phi * phi)));
            for (look = 0; look < looks; look++)
                speckle -= log(uniform(seed, (uint64_t)pixel * looks + look)) / looks;
            power[pixel] = (float)(sigma0 * speckle);
        }
    }
    if (!(file = fopen(argv[2], "wb")) ||
        fwrite(power, sizeof *power, (size_t)rows * columns, file) != (size_t)rows * columns || fclose(file))
        fail("the output cannot be written");
    return 0;
}

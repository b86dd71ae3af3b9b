/* Readings under commands: rows of time (s) and commands from standard input, joined linearly. */
#include <stdio.h>
#include <string.h>
#include "$name.h"

static int read_row(double *row) {
    int i = 0;
    while (i <= ${name}_commands && scanf("%lf", row + i) == 1) i++;
    return i > ${name}_commands;
}

int main(void) {
    $name plant;
    double before[1 + ${name}_commands], row[1 + ${name}_commands], reading[${name}_readings];
    ${name}_start(&plant);
    for (int k = 0; read_row(row); k++, memcpy(before, row, sizeof row)) {
        if (k) ${name}_step(&plant, before + 1, row + 1, row[0] - before[0]);
        ${name}_read(&plant, reading);
        for (int i = 0; i < ${name}_readings; i++) printf("%.17g%c", reading[i], i + 1 < ${name}_readings ? ' ' : '\n');
    }
    return 0;
}

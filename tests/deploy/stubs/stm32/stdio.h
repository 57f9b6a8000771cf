/* Stands in for newlib-nano: puts alone. */
#ifndef STDIO_H
#define STDIO_H
int puts(const char *text);
#endif

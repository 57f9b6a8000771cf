// firmware/examples/own_mechanism.c on an Uno: its printf goes to Serial.
#include <stdio.h>

#define main example
#include "own_mechanism.c"
#undef main

static int put(char letter, FILE *) {
  Serial.write(letter);
  return 0;
}

void setup() {
  static FILE terminal;
  Serial.begin(115200);
  fdev_setup_stream(&terminal, put, NULL, _FDEV_SETUP_WRITE);
  stdout = &terminal;
  example();
}

void loop() {}

/* The rest of Arduino.h: ends when the sketch has printed LINES lines. */
#include "Arduino.h"

SerialPort Serial;

int main()
{
    setup();
    while (Serial.lines < LINES) {
        loop();
    }
    for (volatile uint16_t wait = 0; wait < 10000; wait++) { /* the last byte leaves */
    }
    cli();
    sleep_enable();
    sleep_cpu();
}

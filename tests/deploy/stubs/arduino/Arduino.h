/* Stands in for the Arduino core of an ATmega: Serial on USART0, and a main that calls setup and loop. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdint.h>

class SerialPort
{
  public:
    void begin(long baud)
    {
        (void)baud;
        UCSR0A = _BV(U2X0);
        UCSR0B = _BV(TXEN0);
        UBRR0 = 16;
    }
    void print(const char *text)
    {
        while (*text != '\0') {
            while ((UCSR0A & _BV(UDRE0)) == 0) {
            }
            UDR0 = static_cast<uint8_t>(*text++);
        }
    }
    void print(int number)
    {
        char digit[2] = {static_cast<char>('0' + number % 10), '\0'};
        if (number > 9) {
            print(number / 10);
        }
        print(digit);
    }
    void println(const char *text)
    {
        print(text);
        print("\n");
        lines++;
    }
    int lines = 0;
};

extern SerialPort Serial;
void setup();
void loop();

#endif

// Records a run of a motor: random steps of a PWM drive on pin 9, its current as a voltage on A0, an encoder on pins 2
// and 3, a line of CSV in every period. Put your drive and your sensors in their places.
const unsigned long PERIOD_US = 5000;  // 200 Hz: a line takes 2 ms at 115200 baud
const unsigned int STEP = 40;          // periods that the drive holds a value
const byte DRIVE = 9, CURRENT = A0, A = 2, B = 3;

volatile long counts;

void edge() {
  counts += (digitalRead(A) == digitalRead(B)) ? 1 : -1;
}

void setup() {
  Serial.begin(115200);
  pinMode(A, INPUT_PULLUP);
  pinMode(B, INPUT_PULLUP);
  attachInterrupt(digitalPinToInterrupt(A), edge, CHANGE);
  Serial.println(F("t,duty,current,counts"));
}

void loop() {
  static unsigned long tick, next = micros();
  static byte duty;
  while ((long)(micros() - next) < 0) {
  }
  const int current = analogRead(CURRENT);
  noInterrupts();
  const long now = counts;  // sensors first: the drive of this line holds from here to the next one
  interrupts();
  if (tick % STEP == 0) {
    duty = random(0, 256);
    analogWrite(DRIVE, duty);
  }
  Serial.print(tick * (PERIOD_US / 1000.0), 1);  // [ms]
  Serial.print(',');
  Serial.print(duty);
  Serial.print(',');
  Serial.print(current);
  Serial.print(',');
  Serial.println(now);
  do {  // a line that took too long costs samples, not the clock
    next += PERIOD_US;
    tick++;
  } while ((long)(micros() - next) >= 0);
}

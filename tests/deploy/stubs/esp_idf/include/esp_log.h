#include <stdio.h>
#define ESP_LOGI(tag, format, ...) (void)printf("I %s: " format "\n", tag, __VA_ARGS__)
#define ESP_LOGE ESP_LOGI

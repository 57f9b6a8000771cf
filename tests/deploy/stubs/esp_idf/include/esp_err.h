#define ESP_ERROR_CHECK(call) (void)(call)

#include "tests/fuzz/memory_file.h"
#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/flight_logs/inertial_logs.h"
#include "tileflight/data/flight_logs/telemetry.h"

/// A flight log of any bytes: subtitles, CSV, GPX, KML, NMEA, ULog, DataFlash or a ground station's; Gyroflow's or
/// Betaflight's inertial readings.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const fuzz::MemoryFile file(data, size);
  try {
    if (flight_logs::is_inertial_log(base::read_head(file.path()))) flight_logs::read_inertial_log(file.path());
    flight_logs::read_telemetry(file.path());
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}

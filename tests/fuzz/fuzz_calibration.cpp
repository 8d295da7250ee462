#include "tests/fuzz/memory_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_files.h"

/// A camera's calibration of any bytes, in every form that is read; and all cameras of a camchain.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const fuzz::MemoryFile file(data, size);
  try {
    imaging::read_calibration(file.path());
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  try {
    imaging::read_camchain(file.path());
  } catch (const InputError&) {
  }
  return 0;
}

#include "tileflight/capture/events/hdf5_handle.h"

#include "tileflight/core/base/input_error.h"

namespace tileflight::events {
namespace {

/// The innermost of the library's messages.
herr_t take_message(unsigned depth, const H5E_error2_t* error, void* message) {
  if (depth == 0 && error->desc != nullptr) *static_cast<std::string*>(message) = error->desc;
  return 0;
}

[[noreturn]] void throw_failure(const std::string& place) {
  std::string message;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take_message, &message);
  for (char& c : message) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  throw InputError(place, "HDF5 failed: " + (message.empty() ? std::string("no cause known") : message));
}

}  // namespace

Hdf5Handle::Hdf5Handle(hid_t id, Close close, const std::string& place) : id_(id), close_(close) {
  if (id < 0) throw_failure(place);
}

void require_hdf5(herr_t result, const std::string& place) {
  if (result < 0) throw_failure(place);
}

QuietHdf5::QuietHdf5() {
  H5Eget_auto2(H5E_DEFAULT, &print_, &to_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

QuietHdf5::~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, print_, to_); }

}  // namespace tileflight::events

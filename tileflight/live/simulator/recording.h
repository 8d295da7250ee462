#pragma once

namespace tileflight::simulator {

struct World;

/// The recording of images and poses that the settings describe.
class Recording {
 public:
  explicit Recording(World& world) : world_(world) {}

  /// Starts with the next step. Throws InputError if neither the settings nor the server name a folder.
  void start();
  /// Completes the files. Throws InputError if they cannot be written.
  void stop();
  bool is_recording() const;

 private:
  World& world_;
};

}  // namespace tileflight::simulator

#pragma once

namespace tileflight::simulator {

struct World;

/// The recording of images and poses that the settings describe.
class Recording {
 public:
  explicit Recording(World& world) : world_(world) {}

  void start();
  void stop();
  bool is_recording() const;

 private:
  World& world_;
};

}  // namespace tileflight::simulator

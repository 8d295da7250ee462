#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Images and lenses of the vehicles' cameras, or of the external ones in the settings (`external`, where `vehicle` is
/// ignored).
class Cameras {
 public:
  explicit Cameras(World& world) : world_(world) {}

  std::vector<ImageResponse> get_images(const std::vector<ImageRequest>& requests, const std::string& vehicle,
                                        bool external);
  std::vector<std::uint8_t> get_image(const std::string& camera, int image_type, const std::string& vehicle,
                                      bool external, const std::string& annotation_name = "");
  CameraInfo get_camera_info(const std::string& camera, const std::string& vehicle, bool external) const;
  void set_camera_pose(const std::string& camera, const Pose& pose, const std::string& vehicle, bool external);
  void set_camera_fov(const std::string& camera, float fov_degrees, const std::string& vehicle, bool external);
  std::vector<float> get_distortion_params(const std::string& camera, const std::string& vehicle, bool external) const;
  void set_distortion_param(const std::string& camera, const std::string& name, float value, const std::string& vehicle,
                            bool external);
  void set_lens(const std::string& camera, const LensDescription& lens, const std::string& vehicle, bool external);
  Coverage coverage(const std::string& camera, const std::string& vehicle, bool external);

 private:
  World& world_;
};

}  // namespace tileflight::simulator

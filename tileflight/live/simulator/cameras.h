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

  /// Renders all images at one time of the simulation. Throws InputError for more than 256 images or 64 million pixels.
  std::vector<ImageResponse> get_images(const std::vector<ImageRequest>& requests, const std::string& vehicle,
                                        bool external);
  /// Returns one image as PNG. `annotation_name`: the layer of an image of type Annotation.
  std::vector<std::uint8_t> get_image(const std::string& camera, int image_type, const std::string& vehicle,
                                      bool external, const std::string& annotation_name = "");
  CameraInfo get_camera_info(const std::string& camera, const std::string& vehicle, bool external) const;
  /// Returns the focal length of the Scene image, in millimetres on a film that is 36 mm wide.
  float get_focal_length(const std::string& camera, const std::string& vehicle, bool external) const;
  /// Returns width (36 mm), height and aspect of the Scene image's film, in AirSim's words.
  std::string get_filmback_settings(const std::string& camera, const std::string& vehicle, bool external) const;
  /// Returns the field of view of the Scene image across and down its middle, degrees, in AirSim's words.
  std::string get_current_field_of_view(const std::string& camera, const std::string& vehicle, bool external) const;
  /// Places a camera on its vehicle; an external camera in global NED. Components that are NaN keep their value.
  void set_camera_pose(const std::string& camera, const Pose& pose, const std::string& vehicle, bool external);
  /// Sets the horizontal field of view of all image types; replaces another lens by a pinhole.
  void set_camera_fov(const std::string& camera, float fov_degrees, const std::string& vehicle, bool external);
  /// Returns Brown's coefficients K1, K2, K3, P1, P2.
  std::vector<float> get_distortion_params(const std::string& camera, const std::string& vehicle, bool external) const;
  /// Sets one of the coefficients by its name.
  void set_distortion_param(const std::string& camera, const std::string& name, float value, const std::string& vehicle,
                            bool external);
  /// Sets the lens of all image types.
  void set_lens(const std::string& camera, const LensDescription& lens, const std::string& vehicle, bool external);
  /// Reports how fine the tiles are that a camera sees.
  Coverage coverage(const std::string& camera, const std::string& vehicle, bool external);

 private:
  World& world_;
};

}  // namespace tileflight::simulator

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/data/messages/dataset_messages.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/observation.h"

// What a simulator shows as parts of messages, and the names of its frames.
namespace tileflight::publishing {

std::string frame_of(const std::string& vehicle, const std::string& part);
std::string body_frame(const std::string& vehicle);
std::string odometry_frame(const std::string& vehicle);
std::string camera_frame(const std::string& vehicle, const std::string& camera);
messages::ros::Header header(std::uint64_t time_ns, const std::string& frame);

imaging::RgbImage rgb_of(const simulator::ImageResponse& image);
std::string jpeg_of(const imaging::RgbImage& rgb, int quality);
/// Infinite where there is no surface.
imaging::FloatImage depth_of(const simulator::ImageResponse& image);
std::vector<dataset::ScanPoint> points_of(const simulator::ObservedScan& scan);
/// The sensors on their vehicles, and where odometry begins.
std::vector<messages::ros::FrameTransform> static_transforms_of(const simulator::Observation& now);

bool is_same(const messages::ros::FrameTransform& a, const messages::ros::FrameTransform& b);
/// Whether time and all poses are the same: clients may also place vehicles while time stands still.
bool is_same(const simulator::Observation& a, const simulator::Observation& b);

}  // namespace tileflight::publishing

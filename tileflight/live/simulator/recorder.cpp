#include "tileflight/live/simulator/recorder.h"

#include <ctime>
#include <sstream>
#include <tuple>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::simulator {
namespace fs = std::filesystem;

namespace {

std::string time_of_day() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d-%H-%M-%S", &local);
  return text;
}

/// Creates a folder of this name, with a number appended if it exists.
fs::path new_folder(const fs::path& parent, const std::string& name) {
  std::error_code error;
  fs::create_directories(parent, error);
  for (int i = 0; i < 1000; ++i) {
    const fs::path folder = parent / (i == 0 ? name : name + "-" + std::to_string(i));
    if (fs::create_directory(folder, error) && !error) return folder;
    if (error) break;
  }
  throw InputError(parent.string(), "cannot create a folder for the recording there");
}

/// Keeps letters, digits and a few other characters of a name; others could lead to another folder.
std::string sanitize_file_name(std::string name) {
  for (char& c : name) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '.';
    if (!plain) c = '_';
  }
  return name;
}

void write_bytes(const fs::path& file, const std::string& header, const void* data, std::size_t size) {
  std::ofstream out(file, std::ios::binary);
  out << header;
  out.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  if (!out.flush()) throw InputError(file.string(), "cannot be written");
}

std::string ppm_bytes(const ImageResponse& image) {
  std::string rgb;
  rgb.reserve(image.image_data_uint8.size());
  for (std::size_t i = 0; i + 2 < image.image_data_uint8.size(); i += 3) {
    for (const std::size_t channel : {2, 1, 0}) rgb.push_back(static_cast<char>(image.image_data_uint8[i + channel]));
  }
  return rgb;
}

auto pose_fields(const Pose& pose) {
  const auto& [p, q] = pose;
  return std::make_tuple(p.x_val, p.y_val, p.z_val, q.w_val, q.x_val, q.y_val, q.z_val);
}

}  // namespace

/// A dataset of one camera's images that is being written.
struct Recorder::DatasetOutput {
  dataset::DatasetWriter writer;
  geometry::Trajectory truth;
  std::uint64_t first_ns = 0;
};

Recorder::Recorder(const fs::path& parent, const RecordingSettings& settings)
    : settings_(settings), folder_(new_folder(parent, time_of_day())) {
  fs::create_directory(folder_ / "images");
  lines_.open(folder_ / "airsim_rec.txt");
  lines_ << "VehicleName\tTimeStamp\tPOS_X\tPOS_Y\tPOS_Z\tQ_W\tQ_X\tQ_Y\tQ_Z\tImageFile\n";
  if (!lines_.flush()) throw InputError((folder_ / "airsim_rec.txt").string(), "cannot be written");
}

Recorder::~Recorder() {
  try {
    finish();
  } catch (const std::exception&) {  // an incomplete dataset is removed by its writer
  }
}

std::string Recorder::write_image(const std::string& vehicle, const RecordedImage& picture) {
  const ImageResponse& image = picture.image;
  const std::string kind = image.pixels_as_float ? ".pfm" : image.compress ? ".png" : ".ppm";
  const std::string name = "img_" + sanitize_file_name(vehicle) + "_" + sanitize_file_name(picture.camera.camera) +
                           "_" + std::to_string(image.image_type) + "_" + std::to_string(image.time_stamp) + kind;
  const fs::path file = folder_ / "images" / name;
  const std::string size = std::to_string(image.width) + " " + std::to_string(image.height);
  if (image.pixels_as_float) {
    write_bytes(file, "Pf\n" + size + "\n-1\n", image.image_data_float.data(), image.image_data_float.size() * 4);
  } else if (image.compress) {
    write_bytes(file, "", image.image_data_uint8.data(), image.image_data_uint8.size());
  } else {
    const std::string rgb = ppm_bytes(image);
    write_bytes(file, "P6\n" + size + "\n255\n", rgb.data(), rgb.size());
  }
  return name;
}

void Recorder::add_to_dataset(const RecordingFrame& moment, const RecordedImage& picture) {
  auto& own = datasets_[{moment.vehicle, picture.camera.camera}];
  if (!own) {
    const std::string name =
        "dataset_" + sanitize_file_name(moment.vehicle) + "_" + sanitize_file_name(picture.camera.camera);
    imaging::Calibration calibration;
    calibration.camera = picture.lens;
    own.reset(new DatasetOutput{{folder_ / name, calibration, {.command = "serve", .png = true}}, {}, moment.time_ns});
  }
  const double time_s = 1e-9 * static_cast<double>(moment.time_ns - own->first_ns);
  const std::span<const std::uint8_t> bytes(picture.image.image_data_uint8);
  own->writer.add_encoded_frame(own->truth.size(), time_s, 0.0, std::as_bytes(bytes), ".png");
  own->truth.poses.push_back({time_s, picture.T_local_camera});
}

void Recorder::add(const RecordingFrame& moment) {
  if (settings_.on_move) {
    const auto [last, is_new] = last_pose_.try_emplace(moment.vehicle, moment.pose);
    if (!is_new && pose_fields(last->second) == pose_fields(moment.pose)) return;
    last->second = moment.pose;
  }
  std::string names;
  for (const RecordedImage& picture : moment.images) {
    names += (names.empty() ? "" : ";") + write_image(moment.vehicle, picture);
    const bool colour = picture.image.image_type == 0 && picture.image.compress && !picture.image.pixels_as_float;
    if (settings_.dataset && colour) add_to_dataset(moment, picture);
  }
  const auto& [p, q] = moment.pose;
  std::ostringstream line;
  line << moment.vehicle << '\t' << moment.time_ns / 1'000'000;
  for (const float value : {p.x_val, p.y_val, p.z_val, q.w_val, q.x_val, q.y_val, q.z_val}) line << '\t' << value;
  lines_ << line.str() << '\t' << names << '\n';
  if (!lines_.flush()) throw InputError((folder_ / "airsim_rec.txt").string(), "cannot be written");
}

void Recorder::finish() {
  for (auto& [key, own] : datasets_) {
    own->writer.set_groundtruth(own->truth);
    own->writer.describe("made_by", "tileflight serve");
    own->writer.describe("vehicle", key.first);
    own->writer.describe("camera", key.second);
    own->writer.finish();
  }
  datasets_.clear();
}

}  // namespace tileflight::simulator

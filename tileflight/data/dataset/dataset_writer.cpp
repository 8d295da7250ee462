#include <mutex>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/dataset_metadata.h"
#include "tileflight/data/dataset/frame_list.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

struct FrameTiming {
  double time_s = 0.0;
  double exposure_ms = 0.0;
};

base::OutputFolder output_of(const fs::path& folder, const DatasetWriter::Options& options) {
  return {.folder = folder, .command = options.command, .replace = options.replace, .inputs = options.inputs};
}

fs::path make_temporary(const fs::path& target) {
  std::error_code error;
  fs::create_directories(target.parent_path(), error);
  const fs::path temporary = base::make_temporary_path(target);
  if (!fs::create_directory(temporary, error))
    throw InputError(target.string(), "cannot be created: " + error.message());
  return temporary;
}

std::string times_text(const std::map<std::size_t, FrameTiming>& stamps) {
  std::string text;
  for (const auto& [index, stamp] : stamps)
    text += frame_id(index) + " " + base::fixed_text(stamp.time_s) + " " + base::fixed_text(stamp.exposure_ms) + "\n";
  return text;
}

void require_increasing(const std::string& folder, const std::map<std::size_t, FrameTiming>& stamps) {
  const FrameTiming* before = nullptr;
  for (const auto& [index, stamp] : stamps) {
    if (before != nullptr && !(stamp.time_s > before->time_s))
      throw InputError(folder, "the time of frame " + frame_id(index) + " is not after the one before it");
    before = &stamp;
  }
}

}  // namespace

struct DatasetWriter::Impl {
  base::OutputFolder output;
  fs::path target;  ///< output.folder, resolved
  imaging::Calibration calibration;
  Options options;
  std::mutex mutex;  // guards the members below
  std::map<std::size_t, FrameTiming> timings;
  std::optional<geometry::Trajectory> groundtruth;
  std::vector<GpsFix> gps;
  std::map<std::string, std::string> metadata;

  void write_lists(const fs::path& folder) const {
    require_increasing(target.string(), timings);
    base::write_file(folder / "times.txt", times_text(timings));
    imaging::write_kalibr(folder / "camera.yaml", calibration);
    if (imaging::has_dso_model(calibration.camera)) imaging::write_dso_camera(folder / "camera.txt", calibration);
    if (groundtruth) geometry::write_tum(folder / "groundtruth.txt", *groundtruth);
    if (!gps.empty()) write_gps_csv(folder / "gps.csv", gps);
    base::write_file(folder / "dataset.yaml", format_metadata(metadata));
  }
};

DatasetWriter::DatasetWriter(fs::path folder, imaging::Calibration calibration, Options options)
    : impl_(std::make_unique<Impl>()) {
  impl_->output = output_of(folder, options);
  impl_->target = base::resolve_folder(folder);
  impl_->calibration = std::move(calibration);
  impl_->options = std::move(options);
  if (!impl_->options.is_part) base::require_writable(impl_->output);
  temporary_ = impl_->options.build_folder.empty() ? make_temporary(impl_->target) : impl_->options.build_folder;
  base::make_folder(temporary_ / "images");
}

DatasetWriter::~DatasetWriter() {
  if (!impl_->options.build_folder.empty()) return;
  std::error_code ignored;
  fs::remove_all(temporary_, ignored);  // does not exist after finish(), which renames it
}

void DatasetWriter::add_frame(std::size_t index, double time_s, double exposure_ms, const imaging::RgbImage& image) {
  const bool png = impl_->options.png;
  const std::vector<std::byte> bytes =
      png ? imaging::encode_png(image) : imaging::encode_jpeg(image, impl_->options.jpeg_quality);
  add_encoded_frame(index, time_s, exposure_ms, bytes, png ? ".png" : ".jpg");
}

void DatasetWriter::add_encoded_frame(std::size_t index, double time_s, double exposure_ms,
                                      std::span<const std::byte> bytes, const std::string& extension) {
  base::write_file(temporary_ / "images" / (frame_id(index) + extension),
                   {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  add_existing_frame(index, time_s, exposure_ms);
}

void DatasetWriter::add_existing_frame(std::size_t index, double time_s, double exposure_ms) {
  const std::lock_guard lock(impl_->mutex);
  impl_->timings[index] = {time_s, exposure_ms};
}

void DatasetWriter::set_groundtruth(geometry::Trajectory trajectory) {
  const std::lock_guard lock(impl_->mutex);
  impl_->groundtruth = std::move(trajectory);
}

void DatasetWriter::set_gps(std::vector<GpsFix> fixes) {
  const std::lock_guard lock(impl_->mutex);
  impl_->gps = std::move(fixes);
}

void DatasetWriter::describe(const std::string& key, const std::string& value) {
  const std::lock_guard lock(impl_->mutex);
  impl_->metadata[key] = value;
}

void DatasetWriter::finish() {
  const std::lock_guard lock(impl_->mutex);
  if (impl_->timings.empty()) throw InputError(impl_->target.string(), "no frames were written");
  impl_->write_lists(temporary_);
  if (impl_->options.is_part) return;
  fs::path built = temporary_;
  if (!impl_->options.build_folder.empty()) {
    // Old files must never be in a folder that later renders continue.
    built = base::make_temporary_path(impl_->target);
    std::error_code error;
    fs::rename(temporary_, built, error);
    if (error) throw InputError(impl_->target.string(), "cannot be written: " + error.message());
  }
  try {
    base::install_folder(built, impl_->output);
  } catch (const InputError&) {
    // Stored frames remain available for another attempt.
    std::error_code ignored;
    if (built != temporary_) fs::rename(built, temporary_, ignored);
    throw;
  }
}

}  // namespace tileflight::dataset

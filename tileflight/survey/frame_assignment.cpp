#include "tileflight/survey/frame_assignment.h"

#include <nlohmann/json.hpp>

#include "tileflight/base/input_error.h"

namespace tileflight::survey {
namespace {

FrameRecord make_record(const render::FlightFrame& frame, const std::string& cut) {
  return {frame.exposure_ms, frame.check, cut};
}

/// The tile cuts of existing frames, as read by the first rank before any renders, so that all ranks distribute the
/// same frames.
std::vector<std::string> read_previous_cuts(Ranks& ranks, const FrameStore& kept, std::size_t frames) {
  std::vector<std::string> cuts(frames);
  if (ranks.rank() == 0) {
    for (const auto& [index, frame] : kept.read_frames()) {
      if (index < frames) cuts[index] = frame.cut;
    }
  }
  return nlohmann::json::parse(ranks.all_gather(nlohmann::json(cuts).dump()).front());
}

}  // namespace

FrameAssignment::FrameAssignment(Ranks& ranks, const FrameStore* kept, std::size_t frames,
                                 const std::optional<workflow::IndexRange>& part)
    : ranks_(ranks),
      store_(kept),
      part_(part),
      previous_cuts_(frames),
      is_assigned_(frames, true),
      own_frames_(kept == nullptr ? frames : 0) {
  if (kept != nullptr) previous_cuts_ = read_previous_cuts(ranks, *kept, frames);
}

void FrameAssignment::set_cut(const std::string& cut) {
  cut_ = cut;
  resumed_ = 0;
  std::size_t missing = 0;
  for (std::size_t i = 0; i < is_assigned_.size(); ++i) {
    const bool is_there = !cut.empty() && previous_cuts_[i] == cut;
    resumed_ += is_there ? 1 : 0;
    // Round-robin, since neighbouring frames take equally long.
    is_assigned_[i] =
        !is_there && static_cast<int>(missing++ % static_cast<std::size_t>(ranks_.count())) == ranks_.rank();
    if (part_ && !part_->contains(i)) is_assigned_[i] = false;
  }
}

void FrameAssignment::add(const render::FlightFrame& frame) {
  if (store_ == nullptr) {
    own_frames_[frame.index] = make_record(frame, cut_);
  } else {
    store_->add(frame.index, make_record(frame, cut_));
  }
}

std::vector<FrameRecord> FrameAssignment::collect_frames() const {
  if (store_ == nullptr) return own_frames_;
  const std::map<std::size_t, FrameRecord> kept = store_->read_frames();
  std::vector<FrameRecord> frames;
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < is_assigned_.size(); ++i) {
    const auto frame = kept.find(i);
    if (frame == kept.end() || frame->second.cut != cut_) {
      missing.push_back(i);
    } else {
      frames.push_back(frame->second);
    }
  }
  if (missing.empty()) return frames;
  throw InputError(
      store_->dataset_folder().parent_path().string(),
      "has no frames " + describe_frame_ranges(missing) +
          " rendered from the same tiles as the others: the source changed meanwhile; run the same command again");
}

}  // namespace tileflight::survey

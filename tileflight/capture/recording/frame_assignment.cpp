#include "tileflight/capture/recording/frame_assignment.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"

namespace tileflight::recording {
namespace {

FrameRecord make_record(const render::FlightFrame& frame, const std::string& cut) {
  return {frame.exposure_ms, frame.check, cut};
}

/// The tile cuts of existing frames, as read by the first rank before any renders, so that all ranks distribute the
/// same frames.
std::vector<std::string> read_previous_cuts(jobs::Ranks& ranks, const FrameStore& kept, std::size_t frames) {
  std::vector<std::string> cuts(frames);
  if (ranks.rank() == 0) {
    for (const auto& [index, frame] : kept.read_frames()) {
      if (index < frames) cuts[index] = frame.cut;
    }
  }
  return nlohmann::json::parse(ranks.all_gather(nlohmann::json(cuts).dump()).front());
}

}  // namespace

FrameAssignment::FrameAssignment(jobs::Ranks& ranks, const FrameStore* kept, std::size_t frames,
                                 const std::optional<jobs::IndexRange>& part)
    : ranks_(ranks),
      store_(kept),
      part_(part),
      previous_cuts_(frames),
      is_finished_(frames, false),
      end_(frames),
      own_frames_(kept == nullptr ? frames : 0) {
  if (kept != nullptr) previous_cuts_ = read_previous_cuts(ranks, *kept, frames);
}

void FrameAssignment::set_cut(const std::string& cut) {
  cut_ = cut;
  const jobs::IndexRange own = part_.value_or(jobs::IndexRange{0, is_finished_.size()});
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < is_finished_.size(); ++i) {
    is_finished_[i] = !cut.empty() && previous_cuts_[i] == cut;
    if (!is_finished_[i] && own.contains(i)) missing.push_back(i);
  }
  resumed_ = static_cast<std::size_t>(std::ranges::count(is_finished_, true));
  const auto first_of = [&](int rank) {
    const std::size_t k = missing.size() * static_cast<std::size_t>(rank) / static_cast<std::size_t>(ranks_.count());
    if (rank == 0) return own.begin;
    return k < missing.size() ? missing[k] : own.end;
  };
  begin_ = first_of(ranks_.rank());
  end_ = ranks_.rank() + 1 == ranks_.count() ? own.end : first_of(ranks_.rank() + 1);
}

void FrameAssignment::render_together() {
  begin_ = 0;
  end_ = is_finished_.size();
}

void FrameAssignment::add(std::size_t image, const render::FlightFrame& frame) {
  if (store_ == nullptr) {
    own_frames_[image] = make_record(frame, cut_);
  } else {
    store_->add(image, make_record(frame, cut_));
  }
}

std::vector<FrameRecord> FrameAssignment::collect_frames() const {
  if (store_ == nullptr) return own_frames_;
  const std::map<std::size_t, FrameRecord> kept = store_->read_frames();
  std::vector<FrameRecord> frames;
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < is_finished_.size(); ++i) {
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

}  // namespace tileflight::recording

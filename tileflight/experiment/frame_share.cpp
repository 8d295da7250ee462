#include "tileflight/experiment/frame_share.h"

#include <nlohmann/json.hpp>

#include "tileflight/geometry/input_error.h"

namespace tileflight::experiment {
namespace {

KeptFrame note_of(const sensors::SensedFrame& frame, const std::string& cut) {
  return {frame.exposure_ms, frame.check, cut};
}

/// The cuts of the frames that are there, as the first rank sees them before any renders: all deal out the same frames.
std::vector<std::string> cuts_before(Ranks& ranks, const KeptFrames& kept, std::size_t frames) {
  std::vector<std::string> cuts(frames);
  if (ranks.rank() == 0) {
    for (const auto& [index, frame] : kept.all()) {
      if (index < frames) cuts[index] = frame.cut;
    }
  }
  return nlohmann::json::parse(ranks.exchange(nlohmann::json(cuts).dump()).front());
}

}  // namespace

FrameShare::FrameShare(Ranks& ranks, const KeptFrames* kept, std::size_t frames)
    : ranks_(ranks), kept_(kept), cut_before_(frames), is_mine_(frames, true), own_(kept == nullptr ? frames : 0) {
  if (kept != nullptr) cut_before_ = cuts_before(ranks, *kept, frames);
}

void FrameShare::set_cut(const std::string& cut) {
  cut_ = cut;
  taken_up_ = 0;
  std::size_t missing = 0;
  for (std::size_t i = 0; i < is_mine_.size(); ++i) {
    const bool is_there = !cut.empty() && cut_before_[i] == cut;
    taken_up_ += is_there ? 1 : 0;
    // In turn, since neighbours take equally long.
    is_mine_[i] = !is_there && static_cast<int>(missing++ % static_cast<std::size_t>(ranks_.count())) == ranks_.rank();
  }
}

void FrameShare::add(const sensors::SensedFrame& frame) {
  if (kept_ == nullptr) {
    own_[frame.index] = note_of(frame, cut_);
  } else {
    kept_->add(frame.index, note_of(frame, cut_));
  }
}

std::vector<KeptFrame> FrameShare::all() const {
  if (kept_ == nullptr) return own_;
  const std::map<std::size_t, KeptFrame> kept = kept_->all();
  std::vector<KeptFrame> frames;
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < is_mine_.size(); ++i) {
    const auto frame = kept.find(i);
    if (frame == kept.end() || frame->second.cut != cut_) {
      missing.push_back(i);
    } else {
      frames.push_back(frame->second);
    }
  }
  if (missing.empty()) return frames;
  throw InputError(kept_->dataset_folder().parent_path().string(),
                   "has no frames " + frame_ranges(missing) +
                       " from the tiles of the others: the source changed meanwhile; give the same command again");
}

}  // namespace tileflight::experiment

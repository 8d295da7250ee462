#include "tileflight/experiments/project/excerpt.h"

#include <algorithm>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::project {
namespace {

constexpr double kShortest_s = 2.0;  // an excerpt is not cut below this length

/// Holds the indices of the first and last sample of a part.
struct Part {
  std::size_t first = 0, last = 0;
};

/// Returns the longest run of samples inside the place; nullopt if there is none.
std::optional<Part> longest_inside(const std::vector<TrackSample>& track) {
  std::optional<Part> longest;
  const auto length_s = [&](const Part& part) { return track[part.last].time_s - track[part.first].time_s; };
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (!track[i].is_inside) continue;
    Part part{i, i};
    while (part.last + 1 < track.size() && track[part.last + 1].is_inside) ++part.last;
    if (!longest || length_s(part) > length_s(*longest)) longest = part;
    i = part.last;
  }
  return longest;
}

/// Returns the height that the flight usually has; nullopt if it stays on the ground.
std::optional<double> usual_height_m(const std::vector<TrackSample>& track, const Part& part) {
  constexpr double kOnGround_m = 3.0;
  std::vector<double> heights_m;
  for (std::size_t i = part.first; i <= part.last; ++i)
    if (track[i].height_m > kOnGround_m) heights_m.push_back(track[i].height_m);
  if (heights_m.empty()) return std::nullopt;
  return base::median(heights_m);
}

Choice from_choice(double from_s, std::string reason, Certainty certainty) {
  return {"real.ingest", "from", base::trimmed_text(from_s, 2), std::move(reason), certainty};
}
Choice to_choice(double to_s, std::string reason, Certainty certainty) {
  return {"real.ingest", "to", base::trimmed_text(to_s, 2), std::move(reason), certainty};
}

void add_whole(Excerpt& excerpt, const std::string& reason, Certainty certainty) {
  if (excerpt.choices.empty()) excerpt.choices.push_back({"real.ingest", "from", "", reason, certainty});
}

}  // namespace

Excerpt choose_excerpt(const std::vector<TrackSample>& all, bool above_ground, double duration_s) {
  constexpr double kLow = 0.3, kReached = 0.7, kLowest_m = 6.0;
  std::vector<TrackSample> track;
  for (const TrackSample& sample : all)
    if (sample.time_s >= 0.0 && sample.time_s <= duration_s) track.push_back(sample);
  Excerpt excerpt;
  const std::optional<Part> inside = longest_inside(track);
  if (!inside) {
    add_whole(excerpt, "no position lies within the video and the place", Certainty::kGuess);
    return excerpt;
  }
  Part part = *inside;
  std::string why_from = "before, the flight is not over the place", why_to = "after that it leaves the place";
  const std::optional<double> usual_m = usual_height_m(track, part);
  const std::string over = above_ground ? " above the ground" : " above its take-off point";
  const auto text = [&](const char* what) {
    return what + base::formatted("it flies %.0f m%s", *usual_m, over.c_str());
  };
  if (usual_m && *usual_m > kLowest_m) {
    const auto is_low = [&](std::size_t i) { return track[i].height_m < kLow * *usual_m; };
    const auto is_up = [&](std::size_t i) { return track[i].height_m >= kReached * *usual_m; };
    if (is_low(part.first)) {
      while (part.first < part.last && !is_up(part.first)) ++part.first;
      why_from = text("the take-off is left out; ");
    }
    if (is_low(part.last)) {
      while (part.last > part.first && !is_up(part.last)) --part.last;
      why_to = text("the landing is left out; ");
    }
  }
  if (track[part.last].time_s - track[part.first].time_s < kShortest_s) {
    add_whole(excerpt, "no part of at least 2 s is high enough and over the place", Certainty::kGuess);
    return excerpt;
  }
  const Certainty certainty = above_ground ? Certainty::kLikely : Certainty::kGuess;
  if (part.first > 0) {
    excerpt.from_s = track[part.first].time_s;
    excerpt.choices.push_back(from_choice(excerpt.from_s, why_from, certainty));
  }
  if (part.last + 1 < track.size()) {
    excerpt.to_s = track[part.last].time_s;
    excerpt.choices.push_back(to_choice(*excerpt.to_s, why_to, certainty));
  }
  add_whole(excerpt, "all of it is used: it neither takes off nor lands", certainty);
  return excerpt;
}

Excerpt choose_excerpt_by_motion(const std::vector<MotionSample>& motion, double duration_s) {
  constexpr double kStill = 0.005;  // share of the width a second
  const auto moves = [](const MotionSample& sample) { return !sample.share_per_s || *sample.share_per_s >= kStill; };
  Excerpt excerpt;
  const auto first = std::ranges::find_if(motion, moves);
  const auto last = std::find_if(motion.rbegin(), motion.rend(), moves);
  const bool is_long_enough = first != motion.end() && last->time_s - first->time_s >= kShortest_s;
  if (is_long_enough && first != motion.begin()) {
    excerpt.from_s = first->time_s;
    excerpt.choices.push_back(from_choice(first->time_s, "before, the image stands still", Certainty::kLikely));
  }
  if (is_long_enough && last != motion.rbegin() && last->time_s < duration_s) {
    excerpt.to_s = last->time_s;
    excerpt.choices.push_back(to_choice(last->time_s, "after that the image stands still", Certainty::kLikely));
  }
  add_whole(excerpt, "all of it is used: no heights say where it takes off and lands", Certainty::kGuess);
  return excerpt;
}

Excerpt with_given_ends(Excerpt chosen, std::optional<double> from_s, std::optional<double> to_s) {
  constexpr int kDecimals = 6;
  const auto drop = [&](const std::string& key) {
    std::erase_if(chosen.choices, [&](const Choice& choice) { return choice.key == key; });
  };
  const auto given = [](const char* key, double time_s) {
    return Choice{"real.ingest", key, base::trimmed_text(time_s, kDecimals), "it was given", Certainty::kCertain};
  };
  const bool no_end_is_left = from_s && chosen.to_s && *chosen.to_s <= *from_s;
  const bool no_begin_is_left = to_s && chosen.from_s >= *to_s;
  const bool is_whole = chosen.from_s == 0.0 && !chosen.to_s;
  if (from_s || no_begin_is_left || (is_whole && to_s)) {
    drop("from");
    chosen.from_s = from_s.value_or(0.0);
  }
  if (to_s || no_end_is_left) {
    drop("to");
    chosen.to_s = to_s;
  }
  if (from_s) chosen.choices.insert(chosen.choices.begin(), given("from", *from_s));
  if (to_s) chosen.choices.push_back(given("to", *to_s));
  return chosen;
}

Excerpt leave_out_breaks(Excerpt excerpt, const std::vector<Break>& breaks, double duration_s) {
  constexpr double kMargin_s = 0.002;  // less than half the time between two images
  const double end_s = excerpt.to_s.value_or(duration_s);
  struct Unbroken {
    double from_s = 0.0, to_s = 0.0;
    const Break *before = nullptr, *after = nullptr;
  };
  Unbroken longest, part{excerpt.from_s, end_s, nullptr, nullptr};
  const auto take_if_longer = [&] {
    if (part.to_s - part.from_s > longest.to_s - longest.from_s) longest = part;
  };
  bool goes_on = true;
  for (const Break& one : breaks) {
    if (one.last_s < excerpt.from_s || one.last_s >= end_s) continue;
    part.to_s = one.last_s + kMargin_s;
    part.after = &one;
    take_if_longer();
    goes_on = one.next_s.has_value();
    if (!goes_on) break;
    part = {std::max(excerpt.from_s, *one.next_s - kMargin_s), end_s, &one, nullptr};
  }
  if (goes_on) take_if_longer();
  if (longest.to_s - longest.from_s < kShortest_s) return excerpt;
  const auto replace = [&](const char* key, double time_s, const std::string& reason) {
    std::erase_if(excerpt.choices, [&](const Choice& choice) { return choice.key == key || choice.value.empty(); });
    excerpt.choices.push_back({"real.ingest", key, base::trimmed_text(time_s, 3),
                               reason + "; this is the longest part that goes on", Certainty::kLikely});
  };
  if (longest.before != nullptr) replace("from", excerpt.from_s = longest.from_s, longest.before->what);
  if (longest.after != nullptr) replace("to", *(excerpt.to_s = longest.to_s), longest.after->what);
  return excerpt;
}

}  // namespace tileflight::project

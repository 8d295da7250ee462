#include "tileflight/tiles/fetch/terms.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"

namespace tileflight::fetch {
namespace {

std::string text_of(Use use) {
  switch (use) {
    case Use::kAnalyse:
      return "images for machine analysis";
    case Use::kExtract:
      return "extraction of geometry";
    case Use::kCache:
      return "keeping tiles in a cache";
    case Use::kOffline:
      return "offline use";
  }
  return "";
}

}  // namespace

const ForbiddenUse* TermsOfUse::find_prohibition(Use use) const {
  const auto it = std::find_if(forbidden.begin(), forbidden.end(), [&](const ForbiddenUse& f) { return f.use == use; });
  return it == forbidden.end() ? nullptr : &*it;
}

TermsOfUse unknown_terms(const std::string& provider) { return {provider, "", {}}; }

// "Map Tiles API Policies": the API is for visualisation; image analysis, machine interpretation, extraction of geodata
// and offline use are listed as prohibited, and content must not be pre-fetched, stored or cached except as the
// agreement allows.
TermsOfUse google_terms() {
  const std::string policies = "https://developers.google.com/maps/documentation/tile/policies";
  return {"Google Photorealistic 3D Tiles",
          "https://cloud.google.com/maps-platform/terms",
          {{Use::kAnalyse, "no image analysis or machine interpretation", policies},
           {Use::kExtract, "no extraction of geodata", policies},
           {Use::kCache, "no pre-fetching, storing or caching of content", policies},
           {Use::kOffline, "no offline use", policies}}};
}

// Guide to content and attribution: assets are used "by streaming the data from ion"; uploaded data belongs to the
// user.
TermsOfUse cesium_ion_terms() {
  return {"Cesium ion",
          "https://cesium.com/legal/terms-of-service",
          {{Use::kOffline, "assets are streamed from ion",
            "https://cesium.com/learn/ion/content-usage-and-attribution-guide"}}};
}

void require_permitted(const TermsOfUse& terms, Use use, bool accepted, const std::string& source) {
  const ForbiddenUse* forbidden = terms.find_prohibition(use);
  if (forbidden == nullptr || accepted) return;
  throw InputError(source, "the terms of " + terms.provider + " forbid " + text_of(use) + " (\"" +
                               forbidden->term_text + "\", " + forbidden->url +
                               "); if your own agreement allows it, add --terms-accepted");
}

}  // namespace tileflight::fetch

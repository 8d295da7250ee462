#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tileflight::tiles {

/// Whether a query parameter of this name carries a key, token, session or signature.
bool names_secret(std::string_view parameter);

/// A URL as it may stand in a message: values of secret parameters, long values of others (which may be tokens under
/// another name), and a user name with its password are hidden behind "…".
std::string redacted(std::string_view url);

/// The URL without its secret parameters, user name and fragment: what names the content, whoever asks for it. The
/// other parameters keep their order.
std::string without_secrets(std::string_view url);

/// The value of a query parameter as it stands in the URL (not decoded); empty where there is none.
std::string query_value(std::string_view url, std::string_view parameter);

/// The URL with one more query parameter.
std::string with_parameter(const std::string& url, const std::string& parameter, const std::string& value);

/// The URL with those query parameters of `from` that it has not itself.
std::string with_parameters_of(const std::string& url, std::string_view from);

/// Values of the secret parameters of a URL.
std::vector<std::string> secrets_of(std::string_view url);

/// A text with each of the secrets in it hidden.
std::string scrubbed(std::string text, const std::vector<std::string>& secrets);

}  // namespace tileflight::tiles

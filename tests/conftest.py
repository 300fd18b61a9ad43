"""What every test shares: on a busy machine an example may take long, and that is no failure."""

from hypothesis import settings

settings.register_profile("signlin", deadline=None)
settings.load_profile("signlin")

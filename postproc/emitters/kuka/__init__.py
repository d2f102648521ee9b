"""Plan to KUKA KRL and back."""

from postproc.emitters.kuka.krl import KukaKrl
